"""What only the browser can do for the page: its address, and files to save."""

from __future__ import annotations

import base64
import json

from bokeh.models import CustomJS, TextInput

_ADDRESS = (
    "window.history.replaceState(null, '', cb_obj.value ? '?' + cb_obj.value : window.location.pathname)"
)
_SAVE = """
if (!cb_obj.value) return;
const file = JSON.parse(cb_obj.value);
const bytes = Uint8Array.from(atob(file.content), c => c.charCodeAt(0));
const link = document.createElement('a');
link.href = URL.createObjectURL(new Blob([bytes], {type: file.kind}));
link.download = file.name;
document.body.appendChild(link); link.click(); link.remove();
setTimeout(() => URL.revokeObjectURL(link.href), 1000);
"""
_COPY = """
if (!cb_obj.value) return;
const text = JSON.parse(cb_obj.value).text;
const fall = () => { const t = document.createElement('textarea'); t.value = text; document.body.appendChild(t);
  t.select(); document.execCommand('copy'); t.remove(); };
(navigator.clipboard?.writeText(text) ?? Promise.reject()).catch(fall);
"""
KINDS = {"txt": "text/plain;charset=utf-8", "png": "image/png", "svg": "image/svg+xml"}


class BrowserLink:
    """Invisible widgets that pass texts to the browser."""

    def __init__(self) -> None:
        self._address, self._save = TextInput(visible=False), TextInput(visible=False)
        self._copied = TextInput(visible=False, name="copied")
        self._copied.js_on_change("value", CustomJS(code=_COPY))
        self._address.js_on_change("value", CustomJS(code=_ADDRESS))
        self._save.js_on_change("value", CustomJS(code=_SAVE))
        self._count = 0
        self.widgets = [self._address, self._save, self._copied]

    def address(self, query: str) -> None:
        """Write the settings into the address; the page stays."""
        self._address.value = query

    def save(self, name: str, content: bytes) -> None:
        """Hand a file to the browser's downloads."""
        self._count += 1  # the same file twice is two changes
        kind = KINDS[name.rpartition(".")[2]]
        text = base64.b64encode(content).decode()
        self._save.value = json.dumps({"name": name, "kind": kind, "content": text, "number": self._count})

    def copy(self, text: str) -> None:
        """Put a text on the clipboard."""
        self._count += 1
        self._copied.value = json.dumps({"text": text, "number": self._count})
