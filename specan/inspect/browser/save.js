if (!cb_obj.value) return;
const file = JSON.parse(cb_obj.value);
const bytes = Uint8Array.from(atob(file.content), c => c.charCodeAt(0));
const link = document.createElement('a');
link.href = URL.createObjectURL(new Blob([bytes], {type: file.kind}));
link.download = file.name;
document.body.appendChild(link); link.click(); link.remove();
setTimeout(() => URL.revokeObjectURL(link.href), 1000);
