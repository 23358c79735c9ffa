// How the page writes numbers: 12,345 things, −0.25, 5 %. Vertex numbers are names
// and have no commas, so that they can be typed and searched.

const MINUS = '\u2212';
const NARROW_SPACE = '\u202f';

/** How many there are of something. */
export const count = (number) => number.toLocaleString('en-US');

/** A share of 0 to 1, in whole percent. */
export const percent = (share) => `${Math.round(100 * share)}${NARROW_SPACE}%`;

/** With so many decimals at most, and no zeros after the last one that counts. */
export const decimal = (number, decimals) =>
    Number(number.toFixed(decimals)).toString().replace('-', MINUS);

/** With as many decimals as the others of its column. */
export const fixed = (number, decimals) => number.toFixed(decimals).replace('-', MINUS);

/** A figure of the command line, "2999 of 3000" or "-0.25", as the page writes it. */
export const typeset = (text) => text
    .replace(/(?<![\d.])\d{4,}(?![\d.]*[\d])/g, (digits) => count(Number(digits)))
    .replace(/(?<![\w.)])-(?=\d)/g, MINUS)
    .replace(/(\d) %/g, `$1${NARROW_SPACE}%`);
