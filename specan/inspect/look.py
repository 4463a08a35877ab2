"""How the page looks: one accent colour, light and dark, the same style for widgets and figures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bokeh.models import CustomJS, InlineStyleSheet, Toggle, Widget
from bokeh.themes import Theme

from specan.report.figure_style import COLOURS as PRINTED

if TYPE_CHECKING:
    from bokeh.document import Document

# Black and white would vanish on one of the two backgrounds: grey in the place of black.
COLOURS = (*PRINTED[:6], "#8b8f98")

_LIGHT = {"ink": "#1d2530", "soft": "#5b6675", "line": "#dfe4ea", "paper": "#ffffff", "panel": "#f5f7f9"}
_DARK = {"ink": "#e4e8ee", "soft": "#a3adba", "line": "#343d4a", "paper": "#161b22", "panel": "#1e2530"}
_ACCENT = {"light": "#0072B2", "dark": "#56B4E9"}


def _variables(colours: dict[str, str], accent: str) -> str:
    return "".join(f"--{name}: {value};" for name, value in {**colours, "accent": accent}.items())


# The document's own style; custom properties pass into the shadow roots of the widgets.
TEMPLATE = (
    """{% block preamble %}<style>
:root {"""
    + _variables(_LIGHT, _ACCENT["light"])
    + """ color-scheme: light; }
:root.dark {"""
    + _variables(_DARK, _ACCENT["dark"])
    + """ color-scheme: dark; }
html, body { margin: 0; padding: 0; background: var(--paper); color: var(--ink);
font: 13px/1.45 system-ui, "Segoe UI", sans-serif; }
</style>{% endblock %}
{% block postamble %}<script>
(() => {
  const model = (name) => window.Bokeh?.documents[0]?.get_model_by_name(name);
  const seek = (views, id) => { for (const v of views) { if (v.model.id == id) return v.el;
    const f = seek(v.child_views ?? [], id); if (f) return f; } };
  const press = (name) => { const m = model(name); if (!m) return;
    const all = Bokeh.index; const views = Object.values(all).length ? Object.values(all) : [...all];
    seek(views, m.id)?.shadowRoot.querySelector('button')?.click(); };
  document.addEventListener('keydown', (e) => {
    const at = e.composedPath()[0];
    if (e.ctrlKey || e.metaKey || e.altKey || ['INPUT', 'SELECT', 'TEXTAREA'].includes(at.tagName)) return;
    const tabs = model('tabs');
    if (tabs && e.key >= '1' && e.key <= String(tabs.labels.length)) tabs.active = Number(e.key) - 1;
    else ({n: () => press('save-txt'), p: () => press('save-png'), v: () => press('save-svg'),
      c: () => press('copy-numbers'), l: () => press('copy-command'), d: () => press('dark'),
      '?': () => press('keys')})[e.key]?.();
  });
})();
</script>{% endblock %}"""
)

_WIDGETS = """
:host { color: var(--ink); font-family: system-ui, "Segoe UI", sans-serif; font-size: 13px; }
.bk-input-group > label, .bk-label { color: var(--soft); font-size: 12px; margin-bottom: 1px; }
.bk-input { background: var(--paper); color: var(--ink); border: 1px solid var(--line); border-radius: 5px;
font-size: 13px; padding: 2px 6px; min-height: 26px; height: 26px; }
select.bk-input { padding-right: 20px; } select[multiple].bk-input { height: auto; padding: 2px; }
.bk-input:focus { border-color: var(--accent); box-shadow: none; outline: 1px solid var(--accent); }
.bk-btn { background: var(--panel); color: var(--ink); border: 1px solid var(--line); border-radius: 5px;
font-size: 13px; padding: 3px 9px; overflow: hidden; text-overflow: ellipsis; }
.bk-btn:hover { border-color: var(--accent); color: var(--accent); }
.bk-btn.bk-active { background: var(--accent); border-color: var(--accent); color: var(--paper); box-shadow: none; }
.bk-btn-primary { background: var(--accent); border-color: var(--accent); color: var(--paper); }
.bk-btn-primary:hover { color: var(--paper); filter: brightness(1.1); }
.bk-btn[disabled] { opacity: 0.45; }
.bk-btn-light { background: transparent; border-color: transparent; text-align: left; padding-left: 2px; }
table { border-collapse: collapse; font-size: 12px; font-variant-numeric: tabular-nums; }
th { color: var(--soft); font-weight: 600; text-align: left; padding: 1px 12px 1px 0; position: sticky; top: 0;
background: var(--paper); }
td { padding: 1px 12px 1px 0; border-top: 1px solid var(--line); white-space: nowrap; }
td.long { white-space: normal; }
details > summary { cursor: pointer; color: var(--soft); font-weight: 600; padding: 2px 0; }
p { margin: 4px 0; } h3 { margin: 4px 0; font-size: 14px; } h4 { margin: 6px 0 2px; }
"""
PANEL = {
    "background": "var(--panel)",
    "border": "1px solid var(--line)",
    "border-radius": "6px",
    "padding": "6px",
}


def _theme(colours: dict[str, str]) -> Theme:
    text = {"text_color": colours["ink"]}
    return Theme(
        json={
            "attrs": {
                "Plot": {
                    "background_fill_color": colours["paper"], "border_fill_color": colours["paper"],
                    "outline_line_color": colours["line"], "border_line_color": None,
                },
                "Grid": {"grid_line_color": colours["line"], "grid_line_alpha": 0.8},
                "Axis": {
                    "axis_line_color": colours["soft"], "major_tick_line_color": colours["soft"],
                    "minor_tick_line_color": None, "axis_label_text_color": colours["ink"],
                    "major_label_text_color": colours["soft"], "axis_label_text_font_style": "normal",
                    "axis_label_text_font_size": "12px", "major_label_text_font_size": "11px",
                },
                "Title": {**text, "text_font_size": "12px", "text_font_style": "normal"},
                "Legend": {
                    "background_fill_color": colours["paper"], "background_fill_alpha": 0.8,
                    "label_text_color": colours["ink"], "border_line_color": None,
                },
                "BaseColorBar": {
                    "background_fill_color": colours["paper"], "major_label_text_color": colours["soft"],
                    "title_text_color": colours["ink"],
                },
                "Span": {"line_color": colours["soft"]},
            }
        }
    )  # fmt: skip


THEMES = {False: _theme(_LIGHT), True: _theme(_DARK)}
_CLASS = "document.documentElement.classList.toggle('dark', cb_obj.active);"
_PREFERRED = "if (window.matchMedia('(prefers-color-scheme: dark)').matches) toggle.active = true;"


def dark_toggle(document: Document) -> Toggle:
    """Button that changes between light and dark; at first as the browser prefers."""
    toggle = Toggle(label="Dark", name="dark", width=52)
    toggle.js_on_change("active", CustomJS(code=_CLASS))

    def changed(attribute: str, old: bool, new: bool) -> None:
        document.theme = THEMES[new]

    toggle.on_change("active", changed)
    document.js_on_event("document_ready", CustomJS(args={"toggle": toggle}, code=_PREFERRED))
    return toggle


class Dress:
    """Gives widgets the page's style; one for a document."""

    def __init__(self, document: Document) -> None:
        self._sheet = InlineStyleSheet(css=_WIDGETS)
        document.template = TEMPLATE
        document.theme = THEMES[False]

    def put_on(self, *parts: Any) -> None:
        """Of every widget inside of some parts."""
        for part in parts:
            for widget in part.select({"type": Widget}):
                if self._sheet not in widget.stylesheets:
                    widget.stylesheets = [self._sheet, *widget.stylesheets]
