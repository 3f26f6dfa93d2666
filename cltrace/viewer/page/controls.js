// Sliders: the field of view, samples, lights, and a movie's frames; and which output is on. What they show comes with
// each picture, as other places of a notebook may show the same window.

const SAMPLES = [1, 4, 16, 32, 64, 256, 1024];

/** The controls of these elements. send: tells an event. Returns what a picture calls with its message. */
export function controls($, send) {
  const fov = $("fov"), samples = $("samples"), frame = $("frames"), play = $("play");
  let film = { frames: 1, fps: 25 }, lights = [], playing = null;

  fov.addEventListener("input", () => send("fov", fov.valueAsNumber));
  samples.addEventListener("input", () => send("samples", SAMPLES[samples.value]));
  frame.addEventListener("input", () => {
    stop();
    send("frame", frame.valueAsNumber);
  });
  play.addEventListener("click", () => (playing ? stop() : start()));

  /** From the frame that is seen, at the movie's pace: frames for which there is no time are left out. */
  function start() {
    const first = (frame.valueAsNumber + 1) % film.frames, begun = performance.now();
    play.textContent = "pause";
    playing = setInterval(() => {
      const number = (first + Math.floor(((performance.now() - begun) / 1000) * film.fps)) % film.frames;
      if (number === frame.valueAsNumber) return;
      frame.value = number;
      send("frame", number);
    }, 1000 / film.fps);
  }

  function stop() {
    clearInterval(playing);
    playing = null;
    play.textContent = "play";
  }

  /** Shows what a picture is of. What is still moved stays as it is under the hand. */
  function follow({ kind, state }) {
    if (!state) return;
    film = state;
    $("film").hidden = state.frames === 1;
    frame.max = state.frames - 1;
    $("write").hidden = !state.file;
    $("write").title = state.file;
    $("frame-number").value = `${state.frame} of ${state.frames}`;
    if (state.lights.length !== lights.length || state.lights.some(([name], k) => name !== lights[k].name)) {
      $("lights").replaceChildren(...(lights = state.lights.map(light)).map(({ label }) => label));
    }
    fov.disabled = !state.fov;
    told(fov, state.fov ? `${+state.fov.toFixed(1)}°` : "parallel");
    told(samples, state.samples);
    state.lights.forEach(([, share], k) => told(lights[k].input, `${Math.round(100 * share)} %`));
    if (kind === "moving" || playing) return;
    $("views").querySelector(`[value=${state.view}]`).checked = true;
    frame.value = state.frame;
    if (state.fov) fov.value = state.fov;
    samples.value = SAMPLES.indexOf(state.samples);
    state.lights.forEach(([, share], k) => (lights[k].input.value = share));
  }

  /** What a slider says, for eyes and for screen readers. */
  function told(input, text) {
    input.setAttribute("aria-valuetext", text);
    input.nextElementSibling.value = text;
  }

  function light([name], number) {
    const label = document.createElement("label"), input = document.createElement("input");
    Object.assign(input, { type: "range", min: 0, max: 1, step: 0.05 });
    input.addEventListener("input", () => send("light", number, input.valueAsNumber));
    label.append(`${name} `, input, document.createElement("output"));
    return { name, label, input };
  }

  return follow;
}
