// What the engine needs besides the page, from the server: requests over a WebSocket (docs/guides/results/play.md).

import { Refusal } from "./session.js";

export class ServedHost {
  /** onPush: takes messages that the server sends by itself. onClose: takes the reason if the connection ends. */
  constructor(socket) {
    this.socket = socket;
    this.waiting = new Map();
    this.count = 0;
    this.failure = "The connection has ended. Start lcorpp play again, and reload this page.";
    this.onPush = () => {};
    this.onClose = () => {};
    this.opened = new Promise((resolve) => socket.addEventListener("open", resolve));
    socket.addEventListener("message", (event) => this.receive(JSON.parse(event.data)));
    socket.addEventListener("close", () => this.close());
  }

  async start() {
    return (await this.send({ type: "start" })).model;
  }

  infer(facts, labels) {
    return this.send({ type: "infer", facts, labels });
  }

  classify(sense, samples) {
    return this.send({ type: "samples", sense, samples });
  }

  judge(facts, samples, value) {
    const walked = Object.entries(samples).filter(([, own]) => own.length > 0);
    return this.send({ type: "judge", facts, samples: Object.fromEntries(walked), value });
  }

  log({ facts, labels, steps }) {
    return this.send({ type: "log", facts, labels, steps: steps.map((step) => [step.action, step.observation]) });
  }

  /** Return the reply to a request, without its id and type. */
  send(request) {
    this.count += 1;
    const id = this.count;
    return new Promise((resolve, reject) => {
      if (this.socket.readyState > 1) throw new Refusal(this.failure);
      this.waiting.set(id, { resolve, reject });
      this.opened.then(() => this.socket.send(JSON.stringify({ id, ...request })));
    });
  }

  receive({ id, ...message }) {
    const { type, ...content } = message;
    const request = this.waiting.get(id);
    this.waiting.delete(id);
    if (type !== "error") (request?.resolve ?? this.onPush)(request ? content : message);
    else if (request) request.reject(new Refusal(content.message));
    else this.failure = content.message;
  }

  close() {
    for (const { reject } of this.waiting.values()) reject(new Refusal(this.failure));
    this.waiting.clear();
    this.onClose(this.failure);
  }
}
