// The engine behind a WebSocket: requests are answered in their order.

export class RemoteEngine {
  /** url: of the WebSocket. */
  constructor(url) {
    this.waiting = new Map();
    this.count = 0;
    this.onPush = () => {};
    this.onClose = () => {};
    this.socket = new WebSocket(url);
    this.opened = new Promise((resolve, reject) => {
      this.socket.addEventListener("open", resolve);
      this.socket.addEventListener("close", () => reject(new Error("the server does not answer")));
    });
    this.socket.addEventListener("message", (event) => this.receive(JSON.parse(event.data)));
    this.socket.addEventListener("close", () => this.onClose());
  }

  /** Send a request without id; return a promise of the reply. */
  async send(request) {
    await this.opened;
    this.count += 1;
    const id = this.count;
    const reply = new Promise((resolve) => this.waiting.set(id, resolve));
    this.socket.send(JSON.stringify({ id, ...request }));
    return reply;
  }

  receive(reply) {
    const resolve = this.waiting.get(reply.id);
    this.waiting.delete(reply.id);
    if (resolve) resolve(reply);
    else this.onPush(reply);
  }
}
