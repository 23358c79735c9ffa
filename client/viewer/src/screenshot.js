// A picture of both shapes as they are seen, with their names and the legend.

const BAR = 40;
const MARGIN = 12;
const GRAY = 'rgb(158, 158, 158)';

const styleOf = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** The scale of a layer, or the pattern of a map, below the shapes. */
function drawScale(context, {layer, low, high, bar}, top, width) {
  const length = Math.min(200, width / 3);
  const left = (width - length) / 2;
  const middle = top + BAR / 2;
  context.imageSmoothingEnabled = false;
  context.drawImage(bar, left, middle - 7, length, 14);
  context.textBaseline = 'middle';
  context.textAlign = 'right';
  context.fillText(`${layer}  ${low}`, left - 8, middle);
  context.textAlign = 'left';
  context.fillText(high, left + length + 8, middle);
}

/** What gray stands for, below the shapes. */
function drawGray(context, text, top) {
  const middle = top + BAR / 2;
  const {fillStyle} = context;
  context.fillStyle = GRAY;
  context.fillRect(MARGIN, middle - 7, 28, 14);
  context.fillStyle = fillStyle;
  context.textBaseline = 'middle';
  context.textAlign = 'left';
  context.fillText(text, MARGIN + 36, middle);
}

/**
 * Resolves to a PNG.
 * @param stage draws the shapes
 * @param names what stands above each, by side
 * @param legend scale: {layer, low, high, bar: a canvas}, null for none; gray: what
 *     it stands for, '' for none
 */
export function screenshot(stage, names, {scale, gray}) {
  const {canvas, ratio} = stage;
  const all = canvas.getBoundingClientRect();
  const picture = document.createElement('canvas');
  picture.width = canvas.width;
  const rows = [scale, gray].filter(Boolean).length;
  picture.height = canvas.height + Math.round(ratio * BAR * rows);
  const context = picture.getContext('2d');
  context.fillStyle = styleOf('--stage');
  context.fillRect(0, 0, picture.width, picture.height);
  // Drawn in this task, or the browser has taken it away.
  stage.moving = false;
  stage.drawNow();
  context.drawImage(canvas, 0, 0);
  context.drawImage(stage.overlay.canvas, 0, 0, canvas.width, canvas.height);
  context.scale(ratio, ratio);
  context.fillStyle = styleOf('--text');
  context.font = '15px system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';
  for (const {side, element} of stage.panes) {
    const box = element.getBoundingClientRect();
    context.textBaseline = 'top';
    context.textAlign = 'left';
    context.fillText(names[side], box.left - all.left + MARGIN, box.top - all.top + MARGIN,
        box.width - 2 * MARGIN);
  }
  if (scale) drawScale(context, scale, all.height, all.width);
  if (gray) drawGray(context, gray, all.height + (scale ? BAR : 0));
  return new Promise((resolve) => picture.toBlob(resolve, 'image/png'));
}
