// Runs parts of the page for tests: each line is a JSON object:
//   {model: FILE}       an engine for the exported model in a file
//   {server: URL}       an engine for a page of a server
//   {call: [METHOD, ...ARGUMENTS]}  call a method of that engine
//   {pushed: null}      return the messages that the server sent by itself
//   {close: null}       close the connection
//   {classifier: {...}} begin a stream of samples for a classifier
//   {samples: [...]}    add them to the stream
//   {script: FILE}      run a script that sets globalThis.session
// and prints one JSON object each; {refused: MESSAGE} if the engine refuses a call.
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { pathToFileURL } from "node:url";
import { runInThisContext } from "node:vm";

const page = pathToFileURL(`${process.argv[2]}/`);
const load = (file) => import(new URL(`engine/${file}`, page).href);
const { Refusal, Session } = await load("session.js");
const { ExportedHost } = await load("exported_host.js");
const { ServedHost } = await load("served_host.js");
const { Stream } = await load("stream.js");
let stream = null;
let pushed = [];

const actions = {
  model(file) {
    globalThis.session = new Session(new ExportedHost(JSON.parse(readFileSync(file, "utf8"))));
    return {};
  },
  server(url) {
    const host = new ServedHost(new WebSocket(url));
    pushed = [];
    host.onPush = (message) => pushed.push(message);
    globalThis.session = new Session(host);
    return {};
  },
  async call([method, ...given]) {
    const { session } = globalThis;
    try {
      const reply = await session[method](...given);
      return method === "start" ? session.domain : (reply ?? {});
    } catch (error) {
      if (error.constructor.name !== Refusal.name) throw error; // a script has a class of its own
      return { refused: error.message };
    }
  },
  pushed: () => pushed,
  close() {
    globalThis.session.host.socket.close();
    return {};
  },
  classifier(classifier) {
    stream = new Stream(classifier);
    return {};
  },
  samples(samples) {
    stream.push(samples);
    const { points, track, probabilities } = stream;
    return { points, track, probabilities, class: stream.class };
  },
  script(file) {
    runInThisContext(readFileSync(file, "utf8"));
    return {};
  },
};

for await (const line of createInterface({ input: process.stdin })) {
  const [[name, argument]] = Object.entries(JSON.parse(line));
  process.stdout.write(`${JSON.stringify(await actions[name](argument))}\n`);
}
