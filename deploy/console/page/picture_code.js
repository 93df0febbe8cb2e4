// Codes of a time in a picture: the same cells, and the same way of reading them, as `common/picture_code` has.

const [ROWS, COLUMNS] = [6, 8];
const [WIDE, HIGH] = [COLUMNS + 2, ROWS + 2]; // with the black frame; a white margin of one cell is around it
const THRESHOLDS = [40, 70, 100, 130, 160];
const LEAST_CONTRAST = 30;
const LEAST_PX = 2;
const ASPECT = [0.5, 2.6];

function crc16(bytes) {
  let crc = 0xffff;
  for (const byte of bytes) {
    crc ^= byte << 8;
    for (let bit = 0; bit < 8; bit++) crc = crc & 0x8000 ? ((crc << 1) ^ 0x1021) & 0xffff : (crc << 1) & 0xffff;
  }
  return crc;
}

/** The count of a time in ms: steps of 0.1 ms, 32 bits. */
export const countOf = (time_ms) => Math.floor(time_ms * 10) % 2 ** 32;

/** The 48 cells of a count, row by row; true is white. */
export function cellsOf(count) {
  const body = [24, 16, 8, 0].map((shift) => Math.floor(count / 2 ** shift) % 256);
  const crc = crc16(body);
  return [...body, crc >> 8, crc & 255].flatMap((byte) => [7, 6, 5, 4, 3, 2, 1, 0].map((bit) => Boolean((byte >> bit) & 1)));
}

/** The count that 48 cells say; null where the CRC does not agree. */
export function countIn(cells) {
  const bytes = [0, 1, 2, 3, 4, 5].map((i) => cells.slice(8 * i, 8 * i + 8).reduce((byte, bit) => byte * 2 + Number(bit), 0));
  if (crc16(bytes.slice(0, 4)) !== bytes[4] * 256 + bytes[5]) return null;
  return bytes.slice(0, 4).reduce((count, byte) => count * 256 + byte, 0);
}

/** Draws the code of a count, with its frame and margin, into a 2D context at (x, y); a cell is `px` wide. */
export function drawCode(context, count, x, y, px) {
  context.fillStyle = "#ffffff";
  context.fillRect(x, y, (WIDE + 2) * px, (HIGH + 2) * px);
  context.fillStyle = "#000000";
  context.fillRect(x + px, y + px, WIDE * px, HIGH * px);
  context.fillStyle = "#ffffff";
  cellsOf(count).forEach((white, i) => {
    if (white) context.fillRect(x + (2 + (i % COLUMNS)) * px, y + (2 + Math.floor(i / COLUMNS)) * px, px, px);
  });
}

/** The counts of all codes in a picture: `data` RGBA, as a canvas gives it. */
export function readCodes({ data, width, height }) {
  const luma = new Uint8Array(width * height);
  for (let i = 0; i < luma.length; i++) luma[i] = (77 * data[4 * i] + 150 * data[4 * i + 1] + 29 * data[4 * i + 2]) >> 8;
  const found = new Set();
  for (const threshold of THRESHOLDS) {
    for (const corners of frames(luma, width, height, threshold)) {
      const count = read(luma, width, height, corners);
      if (count !== null) found.add(count);
    }
  }
  return [...found];
}

/** The corners of each dark, connected region that may be a code's frame. */
function frames(luma, width, height, threshold) {
  const seen = new Uint8Array(luma.length);
  const stack = new Int32Array(luma.length);
  const found = [];
  for (let start = 0; start < luma.length; start++) {
    if (seen[start] || luma[start] >= threshold) continue;
    let [left, right, top, bottom] = [width, 0, height, 0];
    const best = [Infinity, -Infinity, -Infinity, Infinity]; // of x + y, x - y, x + y, x - y
    const at = [0, 0, 0, 0];
    let depth = 0;
    stack[depth++] = start;
    seen[start] = 1;
    while (depth) {
      const i = stack[--depth];
      const x = i % width;
      const y = (i - x) / width;
      if (x < left) left = x;
      if (x > right) right = x;
      if (y < top) top = y;
      if (y > bottom) bottom = y;
      if (x + y < best[0]) [best[0], at[0]] = [x + y, i];
      if (x - y > best[1]) [best[1], at[1]] = [x - y, i];
      if (x + y > best[2]) [best[2], at[2]] = [x + y, i];
      if (x - y < best[3]) [best[3], at[3]] = [x - y, i];
      if (x > 0 && !seen[i - 1] && luma[i - 1] < threshold) (seen[i - 1] = 1), (stack[depth++] = i - 1);
      if (x < width - 1 && !seen[i + 1] && luma[i + 1] < threshold) (seen[i + 1] = 1), (stack[depth++] = i + 1);
      if (y > 0 && !seen[i - width] && luma[i - width] < threshold) (seen[i - width] = 1), (stack[depth++] = i - width);
      if (y < height - 1 && !seen[i + width] && luma[i + width] < threshold) (seen[i + width] = 1), (stack[depth++] = i + width);
    }
    const [wide, high] = [right - left + 1, bottom - top + 1];
    if (wide < LEAST_PX * WIDE * 0.8 || high < LEAST_PX * HIGH * 0.8) continue;
    if (wide / high <= ASPECT[0] || wide / high >= ASPECT[1]) continue;
    const outward = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
    found.push(at.map((i, k) => [(i % width) + outward[k][0], Math.floor(i / width) + outward[k][1]]));
  }
  return found;
}

function read(luma, width, height, corners) {
  const plane = projection(corners);
  if (!plane) return null;
  const [margin, frame, cells] = [[], [], []];
  for (let row = -1; row <= HIGH; row++) {
    for (let column = -1; column <= WIDE; column++) {
      const value = sample(luma, width, height, plane, column + 0.5, row + 0.5);
      if (value === null) return null;
      if (row < 0 || row === HIGH || column < 0 || column === WIDE) margin.push(value);
      else if (row === 0 || row === HIGH - 1 || column === 0 || column === WIDE - 1) frame.push(value);
      else cells.push(value);
    }
  }
  const [white, black] = [median(margin), median(frame)];
  if (white - black < LEAST_CONTRAST) return null;
  return countIn(cells.map((value) => value > (white + black) / 2));
}

function median(values) {
  const sorted = [...values].sort((a, b) => a - b);
  const half = sorted.length >> 1;
  return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

/** The 8 numbers that take cells to pixels, by Gauss; null for a flat region. */
function projection(corners) {
  const rows = [[0, 0], [WIDE, 0], [WIDE, HIGH], [0, HIGH]].flatMap(([u, v], i) => {
    const [x, y] = corners[i];
    return [[u, v, 1, 0, 0, 0, -u * x, -v * x, x], [0, 0, 0, u, v, 1, -u * y, -v * y, y]];
  });
  for (let k = 0; k < 8; k++) {
    const pivot = rows.slice(k).reduce((best, row, i) => (Math.abs(row[k]) > Math.abs(rows[best][k]) ? k + i : best), k);
    if (Math.abs(rows[pivot][k]) < 1e-9) return null;
    [rows[k], rows[pivot]] = [rows[pivot], rows[k]];
    for (let i = 0; i < 8; i++) {
      if (i === k) continue;
      const share = rows[i][k] / rows[k][k];
      for (let j = k; j < 9; j++) rows[i][j] -= share * rows[k][j];
    }
  }
  return rows.map((row, k) => row[8] / row[k]);
}

function sample(luma, width, height, [a, b, c, d, e, f, g, h], u, v) {
  const scale = g * u + h * v + 1;
  if (scale <= 1e-6) return null;
  const x = Math.min(Math.max((a * u + b * v + c) / scale, 0), width - 1);
  const y = Math.min(Math.max((d * u + e * v + f) / scale, 0), height - 1);
  const [x0, y0] = [Math.floor(x), Math.floor(y)];
  const [x1, y1] = [Math.min(x0 + 1, width - 1), Math.min(y0 + 1, height - 1)];
  const [fx, fy] = [x - x0, y - y0];
  const above = luma[y0 * width + x0] * (1 - fx) + luma[y0 * width + x1] * fx;
  const below = luma[y1 * width + x0] * (1 - fx) + luma[y1 * width + x1] * fx;
  return above * (1 - fy) + below * fy;
}
