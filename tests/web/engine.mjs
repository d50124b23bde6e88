// Runs parts of the page for tests: each line is a JSON object:
//   {model: FILE}      begin a session with the model in a file
//   {request: {...}}   send it to the session
//   {classifier: {...}} begin a stream of samples for a classifier
//   {samples: [...]}   add them to the stream
//   {script: FILE}     run a script that sets globalThis.engine
//   {send: {...}}      send a request to that engine
// and prints one JSON object each.
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { pathToFileURL } from "node:url";
import { runInThisContext } from "node:vm";

const page = pathToFileURL(`${process.argv[2]}/`);
const { LocalSession } = await import(new URL("engine/session.js", page).href);
const { Stream } = await import(new URL("engine/stream.js", page).href);
let session = null;
let stream = null;

const actions = {
  model(file) {
    session = new LocalSession(JSON.parse(readFileSync(file, "utf8")));
    return {};
  },
  request: (request) => session.handle(request),
  classifier(classifier) {
    stream = new Stream(classifier);
    return {};
  },
  samples(samples) {
    stream.push(samples);
    const { points, track, probabilities } = stream;
    return { points, track, probabilities, class: stream.classify() };
  },
  script(file) {
    runInThisContext(readFileSync(file, "utf8"));
    return {};
  },
  send: (request) => globalThis.engine.send(request),
};

for await (const line of createInterface({ input: process.stdin })) {
  const [[name, argument]] = Object.entries(JSON.parse(line));
  process.stdout.write(`${JSON.stringify(await actions[name](argument))}\n`);
}
