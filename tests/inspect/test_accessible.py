"""WCAG 2.2, levels A and AA, as far as it can be computed, and the layout of a phone; each tab, light and dark."""

from pathlib import Path

import pytest

pytest.importorskip("bokeh")

NOISE = Path(__file__).parents[2] / "sample_data" / "recordings" / "noise" / "noise_24_microphones.tdms"
PHONE = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
LAPTOP = {"width": 1366, "height": 768, "deviceScaleFactor": 1, "mobile": False}
DESK = {"width": 1280, "height": 800, "deviceScaleFactor": 1, "mobile": False}
MODEL = "Bokeh.documents[0].get_model_by_name"
# The page's widgets stand in nested shadow roots; what is laid out and seen counts.
SEEN = """
const elements = [];
const walk = (root) => { for (const e of root.querySelectorAll('*')) {
  elements.push(e); if (e.shadowRoot) walk(e.shadowRoot); } };
walk(document);
const seen = (e) => e.checkVisibility({checkVisibilityCSS: true, checkOpacity: true}) &&
  e.getBoundingClientRect().width > 1;
const kinds = 'button, input:not([type=hidden]), select, textarea, a[href], [tabindex], [role=button]';
const controls = elements.filter((e) => e.matches(kinds) && seen(e));
const labels = (e) => [...(e.labels ?? [])].map((l) => l.textContent).join(' ');
const name = (e) => (e.getAttribute('aria-label') || e.title || labels(e) ||
  (e.matches('button, a, [role=button]') ? e.textContent : '')).trim();
const said = (e) => e.outerHTML.slice(0, 120);
"""
# Relative luminance and contrast as WCAG 2.2 defines them; below a background with alpha shows what lies under it.
CONTRAST = """
const rgba = (text) => { const [r, g, b, a] = text.match(/[\\d.]+/g).map(Number); return [r, g, b, a ?? 1]; };
const above = (e) => e.assignedSlot ?? e.parentElement ?? e.getRootNode().host;
const over = (top, below) => [0, 1, 2].map((k) => top[3] * top[k] + (1 - top[3]) * below[k]).concat(1);
const ground = (e) => { const own = e ? rgba(getComputedStyle(e).backgroundColor) : [255, 255, 255, 1];
  return own[3] === 1 ? own : over(own, ground(above(e))); };
const luminance = (c) => { const [r, g, b] = c.slice(0, 3).map((v) => v / 255).map(
  (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
const written = (e) => e.matches('input:not([type=checkbox]), select') ||
  [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
const texts = elements.filter((e) => seen(e) && !e.matches('option, style, script, :disabled') && written(e));
const ratio = (e) => { const below = ground(e), text = over(rgba(getComputedStyle(e).color), below);
  const [low, high] = [luminance(below), luminance(text)].sort((a, b) => a - b); return (high + 0.05) / (low + 0.05); };
"""


@pytest.fixture
def shown(browser, open_page, serve):
    """Open a tab on a desk, light or dark, and wait for its result; and show what is open on another screen."""

    def show(tab: str, scheme: str = "light"):
        on(DESK)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        page = open_page(f"{serve(str(NOISE))}?tab={tab}")
        page.wait(
            lambda: page.script(f"return {MODEL}('status') && !{MODEL}('status').text.includes('computing')")
        )
        page.wait(lambda: page.script(f"{SEEN} return controls.every(name)"))
        return page

    def on(screen: dict) -> None:
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)

    yield show, on
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def assert_contrast(page) -> None:
    faint = "return texts.map((e) => [ratio(e), said(e)]).filter(([found]) => found < 4.5)"
    assert page.script(f"{SEEN} {CONTRAST} {faint}") == []


@pytest.mark.long
@pytest.mark.parametrize("tab", ["octave", "fft", "frf", "levels", "spectrogram", "orders", "info"])
def test_a_tab_on_a_desk_on_a_laptop_and_on_a_phone(shown, tab):
    show, on = shown
    page = show(tab)
    assert page.script("return document.documentElement.lang") == "en"
    assert NOISE.name in page.script("return document.title")
    assert page.script(f"{SEEN} return elements.filter((e) => e.matches('h1') && seen(e)).length") == 1
    assert page.script(f"{SEEN} return controls.length") > 10
    assert page.script(f"{SEEN} return controls.filter((e) => name(e).length > 40).map(said)") == []
    assert page.script(f"{SEEN} return controls.filter((e) => e.tabIndex > 0).map(said)") == []
    assert_contrast(page)
    on(LAPTOP)
    page.wait(lambda: page.script("return document.documentElement.scrollHeight <= innerHeight"))
    assert page.script("return document.documentElement.scrollWidth <= innerWidth")
    on(PHONE)
    outside = "const r = e.getBoundingClientRect(); return r.left < -1 || r.right > innerWidth + 1;"
    page.wait(lambda: page.script(f"{SEEN} return !controls.some((e) => {{ {outside} }})"))
    assert page.script("return document.documentElement.scrollWidth <= innerWidth")
    # WCAG 2.2, 2.5.8: targets of 24 by 24 pixels.
    small = "const r = e.getBoundingClientRect(); return Math.min(r.width, r.height) < 23.5;"
    assert page.script(f"{SEEN} return controls.filter((e) => {{ {small} }}).map(said)") == []
    assert page.complaints == []


@pytest.mark.long
@pytest.mark.parametrize("tab", ["octave", "orders"])
def test_texts_have_contrast_in_the_dark(shown, tab):
    assert_contrast(shown[0](tab, "dark"))
