// The view: what is done in it goes out as events, and what comes back as messages is shown. It knows no network.
import { controls } from "./controls.js";
import { opened } from "./explanation.js";
import { overlay } from "./overlay.js";

const STEP = 1 / 24; // of the picture's height: an arrow's way
const NOTCH = 600; // pixels of a wheel for a factor of two
const CLICK = 4; // pixels that a pointer may move in a click
const TWICE = 250; // milliseconds in which a second click makes the first one a double click
const KEYS = {
  ArrowLeft: ["orbit", -STEP, 0],
  ArrowRight: ["orbit", STEP, 0],
  ArrowUp: ["orbit", 0, -STEP],
  ArrowDown: ["orbit", 0, STEP],
  "+": ["zoom", 0, -0.25],
  "-": ["zoom", 0, 0.25],
  f: ["fit"],
  o: ["parallel"],
  r: ["back"],
  u: ["undo"],
};

/**
 * Makes the elements of index.html work that are in `root`, a document or a shadow root.
 *
 * tell: takes an event, see messages.py; signal: is aborted when the view goes, if it can. Returns what the channel calls:
 * fail(text) when it is broken, and receive(message, blob) with a message and its data.
 */
export function view(root, tell, signal) {
  const $ = (id) => root.getElementById(id);
  const picture = $("picture"), other = $("other"), slider = $("slider"), difference = $("difference");
  const size = { width: 1, height: 1 }; // of the picture at rest
  const compared = {}; // the pictures that lie over it: mine, difference
  const over = overlay($("overlay"), $("outline"), $("legend"), $("overlaid"));
  const adjusted = controls($, send);
  let saved, home = true; // the PNG at rest, and whether it is by the scene's own camera
  let name = "scene"; // what the scene is called

  /** Tells the server what was done. */
  function send(kind, x = 0, y = 0, name = "") {
    if (kind !== "shown" && kind !== "compare") fail("");
    tell({ kind, x, y, name });
  }

  /** Says what went wrong. */
  function fail(text) {
    $("error").textContent = text;
  }

  const SHOW = {
    moving: showPicture,
    exact: showPicture,
    smooth: showPicture,
    outline: async ({ number }, blob) => {
      await over.setOutline(blob, size);
      send("shown", number);
    },
    lines: ({ text }) => over.setLines(text),
    said: ({ text }) => ($("said").textContent = text),
    explanation: ({ text }) => answer($("explanation"), ...opened(text)),
    comparison: ({ text }) => answer($("comparison"), text),
    copy: ({ text }) => copy(text),
    mine: keep,
    difference: keep,
    fault: showFault,
    error: ({ text }) => fail(text),
  };

  async function showPicture(message, blob) {
    const { kind, text, width, height, number } = message;
    home = message.home;
    const image = await createImageBitmap(blob);
    if (width !== size.width || height !== size.height) resize(width, height);
    // A smaller picture fills the place of the one at rest.
    picture.getContext("2d").drawImage(image, 0, 0, width, height);
    image.close();
    send("shown", number);
    picture.dataset.kind = kind;
    over.follow(message);
    adjusted(message);
    showCompared();
    if (kind === "moving") return;
    $("caption").textContent = text;
    name = text.split(": ")[0];
    if (root === document) document.title = name;
    saved = blob;
  }

  /** Sizes the canvases so that a pixel of the picture is a whole number of the screen's, or all of it fits. */
  function resize(width, height) {
    Object.assign(size, { width, height });
    for (const canvas of [picture, other]) Object.assign(canvas, { width, height });
    Object.assign($("column"), { max: width - 1 });
    Object.assign($("row"), { max: height - 1 });
    layOut();
  }

  function layOut() {
    const room = $("frame").parentElement.clientWidth;
    const fits = Math.min(room / size.width, (innerHeight - 150) / size.height) * devicePixelRatio;
    const scale = (fits >= 1 ? Math.floor(fits) : fits) / devicePixelRatio;
    for (const canvas of [picture, other, $("outline")]) {
      canvas.style.width = `${size.width * scale}px`;
      canvas.style.height = `${size.height * scale}px`;
      canvas.style.imageRendering = fits >= 1 ? "pixelated" : "auto";
    }
  }

  function answer(place, ...nodes) {
    place.hidden = false;
    place.replaceChildren(...nodes);
  }

  async function copy(text) {
    const area = $("copied").querySelector("textarea");
    $("copied").hidden = false;
    area.value = text;
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      area.select(); // pages that came without https may not
    }
  }

  /** What is wrong with the scene's file; when it is another one, the comparison is, too. */
  function showFault({ text }) {
    $("fault").hidden = !text;
    $("fault").textContent = text;
    $("error").textContent = "";
    if (!text) send("compare");
  }

  async function keep({ kind }, blob) {
    compared[kind] = await createImageBitmap(blob);
    $("compare").hidden = false;
    showCompared();
  }

  /** The other picture on the left, or the difference, where the camera is the scene's. */
  function showCompared() {
    const image = difference.checked ? compared.difference : compared.mine;
    other.hidden = !image || !home;
    if (other.hidden) return;
    const context = other.getContext("2d");
    context.clearRect(0, 0, size.width, size.height);
    context.drawImage(image, 0, 0, size.width, size.height);
    other.style.clipPath = difference.checked ? "" : `inset(0 ${100 - slider.value}% 0 0)`;
  }

  /** The column and row of the picture under a pointer. */
  function pixel({ offsetX, offsetY }) {
    const inside = (at, shown, count) => Math.min(count - 1, Math.max(0, Math.floor((at / shown) * count)));
    return [inside(offsetX, picture.clientWidth, size.width), inside(offsetY, picture.clientHeight, size.height)];
  }

  function ask(kind, [x, y]) {
    Object.assign($("column"), { value: x });
    Object.assign($("row"), { value: y });
    send(kind, x, y);
  }

  let pressed = null; // where a pointer is down, and how far it has come
  let asked; // what a click will ask for
  picture.addEventListener("pointerdown", (event) => {
    if (event.button) return;
    picture.setPointerCapture(event.pointerId);
    clearTimeout(asked);
    pressed = { x: event.clientX, y: event.clientY, way: 0 };
  });
  picture.addEventListener("pointermove", (event) => {
    if (!pressed) return;
    const x = event.clientX - pressed.x, y = event.clientY - pressed.y;
    const way = pressed.way + Math.hypot(x, y);
    if (way <= CLICK) return;
    pressed = { x: event.clientX, y: event.clientY, way };
    send(event.shiftKey ? "pan" : "orbit", x / picture.clientHeight, y / picture.clientHeight);
  });
  picture.addEventListener("pointerup", (event) => {
    if (pressed?.way === 0) asked = setTimeout(ask, TWICE, "explain", pixel(event));
    pressed = null;
  });
  picture.addEventListener("pointercancel", () => (pressed = null));
  picture.addEventListener("dblclick", (event) => {
    clearTimeout(asked);
    ask("centre", pixel(event));
  });
  picture.addEventListener("wheel", (event) => {
    if (root !== document && root.activeElement !== picture) return; // it is what is around that scrolls
    event.preventDefault();
    const pixels = event.deltaY * [1, 16, innerHeight][event.deltaMode];
    send("zoom", 0, pixels / NOTCH);
  });

  root.addEventListener("keydown", (event) => {
    const own = event.key.startsWith("Arrow") ? "input, textarea" : "input[type=number], textarea";
    if (!(event.key in KEYS) || event.target.matches(own) || event.ctrlKey || event.metaKey || event.altKey) return;
    const [kind, x = 0, y = 0] = KEYS[event.key];
    event.preventDefault();
    event.stopPropagation(); // what is around the view has keys, too
    send(kind === "orbit" && event.shiftKey ? "pan" : kind, x, y);
  });
  for (const button of root.querySelectorAll("[data-kind]:not(canvas)")) {
    button.addEventListener("click", () => send(button.dataset.kind, 0, 0, button.dataset.name));
  }
  $("views").addEventListener("change", (event) => send("show", 0, 0, event.target.value));
  $("ask").addEventListener("submit", (event) => {
    event.preventDefault();
    send(event.submitter.value, $("column").valueAsNumber, $("row").valueAsNumber);
  });
  $("save").addEventListener("click", () => {
    const link = document.createElement("a");
    const file = name.replace(/^.*\//, "").replace(/\.\w*$/, "");
    Object.assign(link, { href: URL.createObjectURL(saved), download: `${file}.png` });
    link.click();
    URL.revokeObjectURL(link.href);
  });
  $("compare").addEventListener("input", showCompared);
  addEventListener("resize", layOut, { signal });
  new ResizeObserver(layOut).observe($("frame").parentElement);
  return { fail, receive: (message, blob) => SHOW[message.kind](message, blob) };
}
