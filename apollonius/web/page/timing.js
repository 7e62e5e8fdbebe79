// How long frames and moves take.

const KEPT = 600;

/** Durations [ms] of the last few hundred of something, and their 95th percentile. */
export class Timing {
  constructor() {
    this.durations = [];
  }

  add(milliseconds) {
    this.durations.push(milliseconds);
    if (this.durations.length > KEPT) this.durations.shift();
  }

  /** Call a function and keep how long it took. */
  measure(work) {
    const begun = performance.now();
    const result = work();
    this.add(performance.now() - begun);
    return result;
  }

  get p95() {
    const sorted = this.durations.toSorted((a, b) => a - b);
    return sorted[Math.ceil(0.95 * sorted.length) - 1] ?? NaN;
  }
}
