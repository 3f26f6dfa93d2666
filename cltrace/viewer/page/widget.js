// The channel of a notebook's widget: messages of the kernel. widget.py makes one module of the page's; BODY and STYLE
// are index.html's elements and viewer.css, which a shadow root keeps from those of the notebook.
import { view } from "./viewer.js";

async function render({ model, el }) {
  const host = document.createElement("div"), root = host.attachShadow({ mode: "open" });
  const ended = new AbortController(), id = `${Math.random()}`;
  root.innerHTML = `<style>${STYLE}</style>${BODY}`;
  host.dataset.lmSuppressShortcuts = "true"; // keys that are typed here are not JupyterLab's
  el.append(host);
  followTheme(host, ended.signal);
  const page = view(root, teller(model), ended.signal);
  await showFirst(page, new Blob([model.get("picture")]));
  page.fail("The kernel is busy, or not there.");
  const receive = (message, buffers) => page.receive(message, new Blob(buffers));
  const leave = () => model.send({ close: id });
  model.on("msg:custom", receive);
  model.send({ open: id });
  addEventListener("pagehide", leave, { signal: ended.signal });
  return () => {
    model.off("msg:custom", receive);
    leave();
    ended.abort();
  };
}

const WAYS = ["orbit", "pan", "zoom"], SLIDERS = ["fov", "samples", "frame", "light"];

/**
 * Takes events to the kernel. Until it has heard the one before, ways of a pointer are added up, and where a slider is
 * counts instead of where it was: they must not queue.
 */
function teller(model) {
  let waiting = null, heard = true;
  const tell = (event, status) => model.send({ event: JSON.stringify(event) }, { iopub: { status } });
  function next() {
    if (!waiting || !heard) return;
    heard = false;
    tell(waiting, ({ content }) => {
      heard ||= content.execution_state === "idle";
      next();
    });
    waiting = null;
  }
  return (event) => {
    const { kind, x, y } = event;
    if (kind === "shown") return tell(event);
    const same = waiting?.kind === kind && (kind !== "light" || waiting.x === x);
    if (waiting && !same) tell(waiting);
    waiting = same && WAYS.includes(kind) ? { kind, x: waiting.x + x, y: waiting.y + y } : event;
    if (WAYS.includes(kind) || SLIDERS.includes(kind)) return next();
    tell(waiting);
    waiting = null;
  };
}

/** Shows the picture that is there without a kernel, too. */
async function showFirst(page, blob) {
  const { width, height } = await createImageBitmap(blob);
  await page.receive({ kind: "exact", text: "", width, height, number: 0, home: true }, blob);
}

/** Dark where the notebook's letters are light, now and when its theme changes. */
function followTheme(host, signal) {
  const follow = () => {
    const [red, green, blue] = getComputedStyle(document.body).color.match(/[\d.]+/g);
    host.style.colorScheme = +red + +green + +blue > 382 ? "dark" : "light";
  };
  const observer = new MutationObserver(follow);
  observer.observe(document.body, { attributes: true });
  signal.addEventListener("abort", () => observer.disconnect());
  follow();
}

export default { render };
