if (!cb_obj.value) return;
const text = JSON.parse(cb_obj.value).text;
const fall = () => { const t = document.createElement('textarea'); t.value = text; document.body.appendChild(t);
  t.select(); document.execCommand('copy'); t.remove(); };
(navigator.clipboard?.writeText(text) ?? Promise.reject()).catch(fall);
