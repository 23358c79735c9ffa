// Gives files to the person who reads the page.
import {byId, element} from './element.js';

export const isEmbedded = () => globalThis.parent !== globalThis;

/** Whether the frame that holds the page, if any, lets files be saved. */
function maySave() {
  if (!isEmbedded()) return true;
  let frame = null;
  try { frame = globalThis.frameElement; } catch { /* of another origin */ }
  // Nothing is known of a frame that cannot be seen, and browsers refuse silently.
  if (!frame) return false;
  return !frame.hasAttribute('sandbox') || frame.sandbox.contains('allow-downloads');
}

function download(name, blob) {
  const address = URL.createObjectURL(blob);
  const link = element('a', {href: address, download: name});
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

function addressOf(blob) {
  return new Promise((resolve) => {
    const reader = new FileReader();
    reader.addEventListener('load', () => resolve(reader.result));
    reader.readAsDataURL(blob);
  });
}

/** Saves a file; where that is forbidden, shows it, to be copied. */
export async function save(name, blob) {
  if (maySave()) { download(name, blob); return; }
  const dialog = byId('shown');
  const content = blob.type.startsWith('image/') ?
      element('img', {src: await addressOf(blob), alt: name}) :
      element('textarea', {readonly: '', rows: 12, 'aria-label': name});
  if (content.tagName === 'TEXTAREA') content.value = await blob.text();
  const what = content.tagName === 'IMG' ? 'Copy or save the picture by its menu' : 'Copy the text';
  byId('shown-text').textContent = `${what}: this frame lets no file be saved (${name}).`;
  byId('shown-content').replaceChildren(content);
  byId('shown-close').onclick = () => dialog.close();
  dialog.showModal();
  content.select?.();
}
