// The plainest page that follows docs/console.md: it shows the newest view as text, and stops.
const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`);
socket.binaryType = "arraybuffer";
const view = document.getElementById("view");
const picture = document.getElementById("picture");
const acknowledge = (n) => socket.send(JSON.stringify({ kind: "ack", n }));
socket.onmessage = ({ data }) => {
  if (typeof data === "string") {
    const message = JSON.parse(data);
    if (message.kind === "view") view.textContent = JSON.stringify(message, null, 1);
    if (message.n) acknowledge(message.n);
    return;
  }
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  const before = picture.src;
  picture.src = URL.createObjectURL(new Blob([new Uint8Array(data, 4 + length)], { type: "image/jpeg" }));
  URL.revokeObjectURL(before);
  acknowledge(header.n);
};
socket.onclose = () => (view.textContent = "no contact");
document.getElementById("stop").addEventListener("pointerdown", () => {
  socket.send(JSON.stringify({ kind: "stop" }));
  fetch("/api/stop", { method: "POST", keepalive: true, headers: { "Content-Type": "application/json" }, body: "{}" });
});
