// The LSTM of the library, one point after the other; see lcorpp/learning/lstm/network.py.

export function decodeNumbers(text, Type) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  return new Type(bytes.buffer); // little-endian, as in the model
}

export class Lstm {
  /** weights: {inputs (4U, C), recurrent (4U, U), bias (4U), dense (O, U), dense_bias (O)} as base64 of float32. */
  constructor(units, weights) {
    this.units = units;
    for (const [name, text] of Object.entries(weights)) this[name] = decodeNumbers(text, Float32Array);
    this.channels = this.inputs.length / (4 * units);
    this.reset();
  }

  reset() {
    this.hidden = new Float64Array(this.units);
    this.cell = new Float64Array(this.units);
  }

  /** Return the probabilities of the classes after one more point. */
  advance(point) {
    const U = this.units;
    const gates = Float64Array.from(this.bias);
    for (let row = 0; row < 4 * U; row += 1) {
      let sum = gates[row];
      for (let c = 0; c < this.channels; c += 1) sum += this.inputs[row * this.channels + c] * Math.fround(point[c]);
      for (let u = 0; u < U; u += 1) sum += this.recurrent[row * U + u] * this.hidden[u];
      gates[row] = sum;
    }
    for (let u = 0; u < U; u += 1) {
      this.cell[u] = sigmoid(gates[U + u]) * this.cell[u] + sigmoid(gates[u]) * Math.tanh(gates[2 * U + u]);
      this.hidden[u] = sigmoid(gates[3 * U + u]) * Math.tanh(this.cell[u]);
    }
    const scores = Array.from(this.dense_bias, (bias, o) =>
      this.hidden.reduce((sum, value, u) => sum + this.dense[o * U + u] * value, bias),
    );
    return softmax(scores.length === 1 ? [0, scores[0]] : scores);
  }
}

function sigmoid(x) {
  return 1 / (1 + Math.exp(-x));
}

function softmax(scores) {
  const largest = Math.max(...scores);
  const weights = scores.map((score) => Math.exp(score - largest));
  const total = weights.reduce((sum, weight) => sum + weight, 0);
  return weights.map((weight) => weight / total);
}
