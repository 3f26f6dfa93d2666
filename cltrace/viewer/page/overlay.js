// What lies over the picture after a click: the outline of the surface, and the rays that made the pixel's colour.
import { element } from "./explanation.js";

const SVG = "http://www.w3.org/2000/svg";
const NEAR = 1e-3; // of the farther end's distance: what is nearer to the camera is cut off
const WORDS = {
  primary: ["ray of the pixel", "rays of the pixel"],
  mirrored: ["ray from a mirror", "rays from mirrors"],
  refracted: ["ray through glass", "rays through glass"],
  lit: ["shadow ray that reaches its light", "shadow rays that reach their light"],
  "in shadow": ["shadow ray that a surface blocks", "shadow rays that surfaces block"],
  behind: ["light that is behind the surface", "lights that are behind the surface"],
  "beside the cone": ["light whose cone is beside the point", "lights whose cones are beside the point"],
};

/** The overlay of these elements: an <svg> and a <canvas> over the picture, and a list and a box to switch it off. */
export function overlay(svg, outline, legend, shown) {
  let lines = [], matrix = null;

  /** The lines of an explanation, see lines.py; those before it go, and the outline, too. */
  function setLines(text) {
    const found = JSON.parse(text);
    lines = found.lines;
    outline.hidden = true;
    const kinds = Map.groupBy(lines, ({ kind }) => kind);
    const there = Object.keys(WORDS).filter((kind) => kinds.has(kind));
    legend.replaceChildren(...there.map((kind) => entry(kind, kinds.get(kind).length)));
    if (found.count > lines.length) legend.append(element("li", `${found.count - lines.length} more are not drawn`));
    legend.parentElement.hidden = false;
    draw();
  }

  function entry(kind, count) {
    const line = element("li", ` ${count} ${WORDS[kind][count === 1 ? 0 : 1]}`);
    const sample = shape("svg", { width: 26, height: 8, "aria-hidden": true });
    sample.append(shape("line", { x1: 0, y1: 4, x2: 26, y2: 4, class: className(kind) }));
    line.prepend(sample);
    return line;
  }

  /** A picture by another camera: the lines turn with it, and the outline waits for the next one. */
  function follow({ width, height, state }) {
    if (!state) return;
    if (`${matrix}` !== `${state.projection}`) outline.hidden = true;
    matrix = state.projection;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    draw();
  }

  function draw() {
    svg.replaceChildren();
    if (!matrix || !shown.checked) return;
    for (const { kind, start, end } of lines) {
      const [a, b] = clipped(projected(start), projected(end));
      if (!a) continue;
      const place = { x1: a[0] / a[2], y1: a[1] / a[2], x2: b[0] / b[2], y2: b[1] / b[2] };
      svg.append(shape("line", { ...place, class: className(kind) }));
    }
    const [, , w] = lines.length ? projected(lines[0].end) : [0, 0, 0];
    if (w > 0) {
      const [x, y] = projected(lines[0].end);
      svg.append(shape("circle", { cx: x / w, cy: y / w, r: 4 }));
    }
  }

  /** Column times w, row times w, and w, of a point of the world. */
  function projected([x, y, z]) {
    return [0, 4, 8].map((k) => matrix[k] * x + matrix[k + 1] * y + matrix[k + 2] * z + matrix[k + 3]);
  }

  async function setOutline(blob, { width, height }) {
    const image = await createImageBitmap(blob);
    Object.assign(outline, { width, height });
    outline.getContext("2d").drawImage(image, 0, 0);
    outline.hidden = !shown.checked;
  }

  shown.addEventListener("change", () => {
    outline.hidden = !shown.checked;
    draw();
  });
  return { setLines, setOutline, follow };
}

/** The part of a line that is in front of the camera, as two points; none where it is behind. */
function clipped(a, b) {
  const near = NEAR * Math.max(a[2], b[2]);
  if (near <= 0) return [];
  const cut = (p, q) => (p[2] >= near ? p : p.map((c, k) => c + ((near - p[2]) / (q[2] - p[2])) * (q[k] - c)));
  return [cut(a, b), cut(b, a)];
}

const className = (kind) => kind.replaceAll(" ", "-");

function shape(name, attributes) {
  const found = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) found.setAttribute(key, value);
  return found;
}
