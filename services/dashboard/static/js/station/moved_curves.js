// The curves at a moment of the past: what was learnt, moved by the shift that the verdict of that time tells.

/**
 * As the detector moves them: the pump curve by its loss of speed λ, H = c0 (1-λ)² + c1 (1-λ) Q + c2 Q² + residual,
 * the system curve upwards.
 * @param {object} model of a pump, from a `wetwell.model/1`
 * @param {object} verdict of that time; without one, or without a shift, nothing has moved
 */
export function movedCurves(model, verdict) {
  const shift = verdict?.evidence?.shift_m;
  if (!model?.learnt_pump || !shift) return model ? { ...model, now_pump: null, now_system: null } : model;
  const loss = verdict.evidence.severity?.speed_loss_percent?.value;
  const speed = 1 - (loss ?? 0) / 100;
  const { flow_m3h: flows, head_m: heads } = model.configured_pump;
  const [c0, c1, c2] = parabola(flows, heads);
  const moved = flows.map((flow, place) => c0 * speed ** 2 + c1 * speed * flow + c2 * flow ** 2 + model.learnt_pump.head_m[place] - heads[place] + (loss == null ? shift.pump : 0));
  const above = model.learnt_system.head_m.map((head) => head + shift.system);
  const curve = (head) => ({ flow_m3h: flows, head_m: head, low_m: [], high_m: [] });
  return { ...model, now_pump: curve(moved), now_system: curve(above) };
}

/** Coefficients of the parabola through the first, middle and last point. */
function parabola(x, y) {
  const [a, b, c] = [0, Math.floor((x.length - 1) / 2), x.length - 1];
  const slope = (i, j) => (y[j] - y[i]) / (x[j] - x[i]);
  const c2 = (slope(b, c) - slope(a, b)) / (x[c] - x[a]);
  const c1 = slope(a, b) - c2 * (x[a] + x[b]);
  return [y[a] - c1 * x[a] - c2 * x[a] ** 2, c1, c2];
}
