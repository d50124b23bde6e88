// The engine in the page: replies to requests from a model, without a server.

import { LocalSession } from "./session.js";

export class LocalEngine {
  /** model: the JSON of lcorpp/web/model.py. */
  constructor(model) {
    this.session = new LocalSession(model);
    this.count = 0;
    this.onPush = () => {};
    this.onClose = () => {};
  }

  /** Send a request without id; return a promise of the reply. */
  async send(request) {
    this.count += 1;
    return this.session.handle({ id: this.count, ...request });
  }
}
