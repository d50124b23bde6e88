// The page: composes the instruments, and passes on what you do and what the engine returns.

import { readAddress, writeAddress } from "./address.js";
import { BeliefPicture } from "./belief.js";
import { Dialogue, pressKey } from "./dialogue.js";
import { element, percent, phrase, readable, show } from "./dom.js";
import { ExportedHost } from "./engine/exported_host.js";
import { ServedHost } from "./engine/served_host.js";
import { Session } from "./engine/session.js";
import { Knowledge } from "./knowledge.js";
import { Learning } from "./learning.js";
import { Palette } from "./marks.js";
import { Stage } from "./stage.js";
import { Strip } from "./strip.js";
import { Trial } from "./trial.js";
import { Walker } from "./walker.js";
import { WALKS } from "./walks.js";
import { showReasons } from "./why.js";

const NEXT_TRIAL = "Try to fool it: walk one way, and answer another.";

class Page {
  constructor(host) {
    this.session = new Session(host);
    host.onPush = (message) => this.receive(message);
    host.onClose = (reason) => this.refuse(reason);
  }

  async open() {
    await this.session.start();
    const domain = this.session.domain;
    this.domain = domain;
    this.sense = domain.senses.find((sense) => sense.kind === "track") ?? null;
    const palette = new Palette(domain);
    show("description", domain.description);
    document.body.classList.toggle("no-stage", this.sense === null);
    this.trial = new Trial(this.session, this.sense, this.makeViews());
    this.walker = new Walker((path) => this.move(path), () => this.rest());
    if (this.sense !== null) this.addStage(palette);
    else show("rules-lead", "Rules with probabilities tell what follows from what the robot sees.");
    this.knowledge = new Knowledge(domain, palette, (kind, name, value) => this.choose(kind, name, value));
    this.belief = new BeliefPicture(domain, palette);
    const describe = (shared) => this.belief.describe(shared);
    this.dialogue = new Dialogue(domain, describe, () => this.decide(), (said) => this.trial.answer(said));
    this.learning = new Learning(domain, palette, (truth) => this.trial.judge(truth));
    document.getElementById("restart").addEventListener("click", () => this.restart());
    document.getElementById("copy").addEventListener("click", () => this.copy());
    document.addEventListener("keydown", (event) => this.press(event));
    document.addEventListener("keyup", (event) => this.walker.release(event.key, event.shiftKey));
    window.addEventListener("blur", () => this.walker.release(null, false));
    await this.begin(readAddress(location.hash));
    document.body.classList.add("ready");
  }

  addStage(palette) {
    const hover = (index) => {
      this.stage.highlight(index);
      this.strip.highlight(index);
    };
    this.stage = new Stage(this.sense, palette, this.walker, hover);
    this.strip = new Strip(this.sense, palette, hover);
    show("stage", this.stage.svg, this.strip.svg);
    const walks = Object.entries(WALKS).map(([name, { label }]) =>
      element("button", { type: "button", "data-walk": name, onclick: () => this.play(name) }, label),
    );
    show("walks", ...walks);
    show("legend", this.stage.legend);
  }

  makeViews() {
    return {
      refused: (message) => this.refuse(message),
      started: () => this.knowledge.setDomain(this.session.domain),
      predicted: (prediction) => this.showPrediction(prediction),
      inferred: (posterior) => this.showPosterior(posterior),
      acted: (view, step) => this.showAct(view, step),
      judged: (reply) => {
        this.learning.thank(reply, this.nextTrial(), this.trial.path);
        this.hint(NEXT_TRIAL);
      },
    };
  }

  /** Begin a trial from a state of the address; its walk and its answers are repeated. */
  async begin({ seed, facts, labels, walk, path, answers }) {
    this.walker.reset();
    this.stage?.reset();
    this.strip?.reset();
    this.belief.reset();
    this.dialogue.reset();
    this.learning.hide();
    this.setStep(this.sense === null ? 2 : 1);
    showReasons(this.domain, null);
    document.getElementById("copy").disabled = true;
    show("walk-output", "no label yet: walk first");
    show("action-output", "nothing yet");
    this.hint(this.sense === null ? `Choose ${this.listFacts()}, then let it decide.` : `Decide for yourself: ${this.listValues()}? Then walk so.`);
    await this.trial.begin(seed ?? crypto.getRandomValues(new Uint32Array(1))[0], facts, labels);
    if (this.sense !== null && Object.hasOwn(WALKS, walk)) this.walker.play(walk, true);
    else if (this.sense !== null && path) this.walker.follow(path);
    if (answers !== null) {
      await this.decide();
      for (const said of answers) await this.trial.answer(said);
    }
  }

  listValues() {
    return this.domain.values.length <= 4 ? this.domain.values.map(readable).join(" or ") : "what you want";
  }

  /** Return what the robot sees, for a hint. */
  listFacts() {
    const names = this.domain.facts.map((own) => readable(own.name));
    return names.length === 0 ? "what the robot sees" : `${names.join(", ").replace(/, ([^,]*)$/, " and $1")} in step 2`;
  }

  restart() {
    const { facts, labels } = this.trial;
    document.getElementById("restart").focus({ preventScroll: true });
    return this.begin({ seed: null, facts, labels, walk: null, path: null, answers: null });
  }

  nextTrial() {
    return { text: "New trial", hasKey: false, onpress: () => this.restart() };
  }

  /** Walk as prepared; after a trial this begins the next one. */
  async play(name) {
    if (this.trial.phase === "asking") {
      this.hint("The robot waits for your answer; or begin a new trial.");
      return;
    }
    if (this.trial.phase !== "before") await this.restart();
    this.walker.reset();
    this.stage.reset();
    this.strip.reset();
    await this.trial.beginTrack();
    this.walker.play(name, matchMedia("(prefers-reduced-motion: reduce)").matches);
    this.hint(`Watch the path take colour, then choose ${this.listFacts()}.`);
  }

  move(path) {
    this.stage.showPath(path);
    this.trial.walk(path);
  }

  /** The person stands. */
  rest() {
    if (this.trial.phase === "before" && this.walker.path.length > 0) this.hint(`Choose ${this.listFacts()}, then let it decide.`);
    this.remember();
  }

  choose(kind, name, value) {
    this.setStep(2);
    this.trial.choose(kind, name, value).then(() => this.remember());
    this.hint("See how the bars move. Then let the robot decide.");
  }

  async decide() {
    this.walker.lock();
    this.setStep(3);
    await this.trial.decide();
  }

  showPrediction(prediction) {
    this.stage.addPrediction(prediction);
    this.strip.add(prediction);
    const { probabilities, label } = prediction;
    if (probabilities === null) return;
    const meaning = this.sense.labels.find((own) => own.label === label).class;
    const k = this.sense.classes.indexOf(meaning);
    show("walk-output", "label \u201c", element("strong", {}, readable(label)), `\u201d: ${readable(meaning)}, it is ${percent(probabilities[k])} sure`);
    show("walk-table", this.strip.makeTable());
  }

  showPosterior(posterior) {
    const { facts, labels, phase, answers } = this.trial;
    const isLocked = phase !== "before" || answers !== null;
    this.knowledge.draw(posterior, { facts, labels }, isLocked);
    show("belief-output", ...this.belief.describe(posterior.shared), element("span", { class: "quiet" }, ", before any question"));
    if (!isLocked) this.belief.preview(posterior.shared, posterior.fan);
    else this.belief.reset();
    this.refuse("");
  }

  showAct(view, step) {
    this.belief.add(view.shared, view.fan);
    this.dialogue.add(view, step);
    showReasons(this.domain, view, (shared) => this.belief.describe(shared));
    document.getElementById("copy").disabled = false;
    if (view.action !== null) show("action-output", element("strong", {}, phrase(this.domain, view.action)));
    if (view.report !== null) this.learning.ask(view.report, this.nextTrial());
    const asking = this.domain.noisy ? "Answer as you like: the robot may mishear you." : "Answer as you like, with a button or its number.";
    const ending = this.domain.learns ? "The robot has made up its mind. Was it right?" : NEXT_TRIAL;
    this.hint(view.done ? ending : asking);
    this.announce(view, step);
    this.remember();
    this.refuse("");
  }

  /** Tell what the robot does, for screen readers. */
  announce(view, step) {
    const heard = step === null ? "" : `You said ${phrase(this.domain, step.said)}, it heard ${phrase(this.domain, step.heard)}. `;
    const belief = this.domain.values.length <= 4 ? this.domain.values.map((value, k) => `${readable(value)} ${percent(view.shared[k])}`).join(", ") : "";
    const act = view.report === null ? `The robot does: ${view.action === null ? "nothing" : phrase(this.domain, view.action)}.` : `The robot reports: ${readable(view.report)}.`;
    show("live", `${heard}${belief ? `It believes ${belief}. ` : ""}${act}`);
  }

  receive(message) {
    this.learning.push(message, this.sense, this.trial.phase === "judged");
    show("live", message.type === "learning" ? "The classifier trains." : "The classifier has learnt.");
  }

  async copy() {
    try {
      const text = JSON.stringify(await this.trial.record());
      const shown = document.getElementById("record");
      shown.querySelector("textarea").value = text;
      try {
        await navigator.clipboard.writeText(text);
        this.refuse("The trial is on the clipboard, as a line of the decision log.");
      } catch {
        shown.showModal();
      }
    } catch (error) {
      this.refuse(error.message);
    }
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("select, textarea, dialog")) return;
    if (/^[1-9]$/.test(event.key) && !event.repeat && pressKey(event.key)) event.preventDefault();
    const isFree = event.target === document.body || event.target === this.stage?.svg;
    const isArrow = event.key.startsWith("Arrow") && event.target.closest("button") !== null;
    if ((isFree || isArrow) && this.sense !== null && this.trial.phase === "before") {
      if (this.walker.press(event.key, event.shiftKey)) event.preventDefault();
    }
  }

  /** Keep the trial in the address. */
  remember() {
    const { seed, facts, labels, path, answers } = this.trial;
    if (facts === undefined) return;
    const walk = this.walker.prepared;
    const own = walk === null && path.length > 0 ? path : null;
    history.replaceState(null, "", writeAddress({ seed, facts, labels, walk, path: own, answers }));
  }

  setStep(number) {
    document.querySelectorAll("[data-step]").forEach((part) => part.classList.toggle("active", part.dataset.step === String(number)));
  }

  hint(text) {
    show("hint", text);
  }

  refuse(message) {
    show("status", message);
  }
}

function makeHost() {
  if (globalThis.LCORPP_MODEL) return new ExportedHost(globalThis.LCORPP_MODEL);
  return new ServedHost(new WebSocket(new URL("session", location.href.replace(/^http/, "ws"))));
}

new Page(makeHost()).open().catch((error) => show("status", `The page cannot be opened: ${error.message}`));
