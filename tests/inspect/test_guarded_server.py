"""Who does not know the page's address gets nothing: raw requests with foreign headers, and a real browser."""

import hashlib
import http.server
import socket
import threading
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from specan.study.create import begin

pytest.importorskip("bokeh")
ROOT = Path(__file__).parents[2]
NOISE = ROOT / "sample_data" / "recordings" / "noise" / "noise_24_microphones.tdms"
GEAR = ROOT / "sample_data" / "worm_gear"


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("study") / "s"
    begin(place, "worm-gear", GEAR / "rig.toml", [GEAR / "table_8_loaded.csv"])
    return place


def ask(url: str, request: str) -> str:
    """The answer of the server to lines as they stand here."""
    at = urlsplit(url)
    with socket.create_connection((at.hostname, at.port), timeout=30) as line:
        line.sendall(request.replace("\n", "\r\n").encode())
        found = b""
        while b"\r\n\r\n" not in found and (part := line.recv(65536)):
            found += part
        return found.decode("latin-1")


def websocket(url: str, host: str, origin: str | None, path: str | None = None) -> str:
    path = urlsplit(url).path + "ws" if path is None else path
    lines = [f"GET {path} HTTP/1.1", f"Host: {host}", "Upgrade: websocket", "Connection: Upgrade"]
    lines += ["Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version: 13"]
    lines += ["Sec-WebSocket-Protocol: bokeh, eyJzZXNzaW9uX2lkIjogIngifQ"]
    lines += [f"Origin: {origin}"] if origin else []
    return ask(url, "\n".join([*lines, "", ""])).split("\r\n")[0]


def status(url: str, host: str, path: str | None = None) -> str:
    path = urlsplit(url).path if path is None else path
    return ask(url, f"GET {path} HTTP/1.1\nHost: {host}\nConnection: close\n\n").split("\r\n")[0]


def test_a_host_that_is_not_the_bound_address_is_refused(serve):
    url = serve(str(NOISE))
    own = urlsplit(url).netloc
    port = own.rpartition(":")[2]
    assert " 200 " in status(url, own)
    for host in (f"evil.example:{port}", "127.0.0.1", "127.0.0.1:9", f"[::1]:{port}", f"127.0.0.1.evil.example:{port}",
                 f"{own}, evil.example", "", f"evil.example@{own}", f"127.1:{port}"):  # fmt: skip
        assert " 403 " in status(url, host) or " 400 " in status(url, host), host
    # A request without any Host, and two of them.
    assert " 200 " not in ask(url, f"GET {urlsplit(url).path} HTTP/1.0\n\n")
    twice = f"GET {urlsplit(url).path} HTTP/1.1\nHost: {own}\nHost: evil.example\nConnection: close\n\n"
    assert " 200 " not in ask(url, twice).split("\r\n")[0]


def test_without_the_secret_nothing_is_shown(serve):
    url = serve(str(NOISE))
    own, path = urlsplit(url).netloc, urlsplit(url).path
    assert len(path.strip("/")) >= 22  # 128 bits
    for other in ("/", "/ws", "/autoload.js?bokeh-autoload-element=x", "/static/js/bokeh.min.js",
                  "/metadata", path[:-2] + "/",
                  "//" + path.strip("/") + "/", "/x" + path, "/favicon.ico"):  # fmt: skip
        assert " 200 " not in status(url, own, other), other
        assert "autoload" not in other or "Access-Control" not in ask(
            url, f"GET {other} HTTP/1.1\nHost: {own}\n\n"
        )


def test_the_address_that_a_browser_is_started_with_leads_to_the_page_once():
    from specan.inspect.server import start_server

    server = start_server(lambda document: None)
    loop = threading.Thread(target=server.io_loop.start)
    other = start_server(lambda document: None)
    other.stop()
    assert urlsplit(other.url).path != urlsplit(server.url).path
    own, first, page = urlsplit(server.url).netloc, urlsplit(server.first_url).path, urlsplit(server.url).path
    try:
        assert page.strip("/") not in server.first_url
        loop.start()
        assert " 403 " in status(server.url, "evil.example", first)
        answer = ask(server.url, f"GET {first} HTTP/1.1\nHost: {own}\nConnection: close\n\n")
        assert " 302 " in answer.split("\r\n")[0]
        assert f"location: {page}" in answer.lower().replace(page.lower(), page)
        assert "no-store" in answer or "cache-control" not in answer.lower()
        assert " 403 " in status(server.url, own, first)
        assert " 200 " in status(server.url, own, page)
    finally:
        server.io_loop.add_callback(server.io_loop.stop)
        loop.join()
        server.stop()


def test_no_answer_may_stand_in_a_frame(serve):
    url = serve(str(NOISE))
    for path in (urlsplit(url).path, "/", urlsplit(url).path + "static/js/bokeh.min.js"):
        head = ask(url, f"GET {path} HTTP/1.1\nHost: {urlsplit(url).netloc}\nConnection: close\n\n").lower()
        assert "content-security-policy: frame-ancestors 'none'" in head
        assert "x-frame-options: deny" in head
        assert "access-control-allow-origin" not in head


@pytest.mark.long
def test_a_websocket_names_the_page_as_its_origin(serve, study):
    before = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in study.glob("*.*") if p.is_file()}
    url = serve(str(study))
    own = urlsplit(url).netloc
    port = own.rpartition(":")[2]
    assert " 101 " in websocket(url, own, f"http://{own}")
    evil = f"evil.example:{port}"
    for host, origin in (
        (evil, f"http://{evil}"), (own, f"http://{evil}"), (evil, f"http://{own}"), (own, None), (own, "null"),
        (own, f"https://{own}"), (own, f"http://localhost:{port}"), (evil, None),
    ):  # fmt: skip
        assert " 403 " in websocket(url, host, origin), (host, origin)
    assert " 403 " in websocket(url, own, f"http://{own}", "/ws")
    assert before == {
        p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in study.glob("*.*") if p.is_file()
    }


@pytest.mark.long
def test_a_rebound_name_reads_nothing_and_accepts_nothing(serve, study, new_browser, open_page_in):
    # For this browser evil.example is this machine, as after DNS rebinding.
    rebound = new_browser("--host-resolver-rules=MAP evil.example 127.0.0.1")
    before = (study / "study.toml").read_bytes()
    url = serve(str(study))
    own, path = urlsplit(url).netloc, urlsplit(url).path
    port = own.rpartition(":")[2]
    # The secret is no help to a foreign name.
    rebound.get(f"http://evil.example:{port}{path}")
    assert "not known here" in rebound.find_element("tag name", "body").text
    assert rebound.execute_script("return typeof window.Bokeh") == "undefined"
    # A page from elsewhere, which knows even the secret: websocket, frame, scripts.
    page = b"<!DOCTYPE html><title>evil</title><body>evil</body>"

    class Evil(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(page)

        def log_message(self, *_) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Evil) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        rebound.get(f"http://evil.example:{server.server_address[1]}/")
        rebound.set_script_timeout(60)
        tries = rebound.execute_async_script(
            """
            const [own, evil, path, done] = arguments;
            const socket = (host) => new Promise((answer) => {
                const ws = new WebSocket(`ws://${host}${path}ws`, ["bokeh", "eyJzZXNzaW9uX2lkIjogIngifQ"]);
                ws.onopen = () => answer("open"); ws.onerror = () => answer("refused");
            });
            const text = (host) => fetch(`http://${host}${path}`).then((r) => r.text()).catch(() => "refused");
            Promise.all([socket(own), socket(evil), text(own), text(evil)]).then(done);
            """,
            own, f"evil.example:{port}", path,
        )  # fmt: skip
        server.shutdown()
    assert tries == ["refused"] * 4
    assert (study / "study.toml").read_bytes() == before
    # The page itself works in this browser.
    page = open_page_in(rebound, url)
    page.wait(lambda: "efficiency" in page.text("trial"))
