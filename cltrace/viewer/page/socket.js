// The page's channel: a websocket to the server that the page is from. It connects again where the line was broken.
import { view } from "./viewer.js";

const ME = crypto.randomUUID(); // by which the server knows this window when the line was broken
let socket;
const page = view(document, (event) => {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(event));
});

function connect() {
  socket = new WebSocket(new URL(`socket?window=${ME}`, location.href.replace(/^http/, "ws")));
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => receive(new Uint8Array(data));
  socket.onclose = () => {
    page.fail("The server is not there. This page tries again.");
    setTimeout(connect, 1000);
  };
}

/** A message: a line of JSON, and what follows it. */
function receive(bytes) {
  const end = bytes.indexOf(10);
  page.receive(JSON.parse(new TextDecoder().decode(bytes.subarray(0, end))), new Blob([bytes.subarray(end + 1)]));
}

connect();
