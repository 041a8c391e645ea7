'use strict';
const parts = {};
const query = location.search;
let newest = 0;
let received = performance.now();
let isCut = false;

const byId = (id) => document.getElementById(id);
const isNumber = (x) => typeof x === 'number' && Number.isFinite(x);
/** A number with so many decimals; never "-0.0". */
const fixed = (x, n) => {
  if (!isNumber(x)) return '–';
  const text = x.toFixed(n);
  return Number(text) === 0 ? (0).toFixed(n) : text;
};
const place = (x, unit) => unit === 'mm' ? fixed(x, 4) : fixed(x === null ? NaN : x * 180 / Math.PI, 5);
/** A small length in µm, a small angle in seconds of arc. */
const small = (x, unit) => unit === 'mm' ? fixed(x === null ? NaN : x * 1000, 1) : fixed(x === null ? NaN : x * 648000 / Math.PI, 1);
const um = (x) => small(x, 'mm');
const time = (at) => isNumber(at) ? new Date(at).toLocaleTimeString([], { hour12: false }) : '–';
const left = (s) => s < 90 ? `${Math.round(s)} s` : s < 5400 ? `${Math.round(s / 60)} min` : `${(s / 3600).toFixed(1)} h`;

function make(tag, text, kind) {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  if (kind) element.className = kind;
  return element;
}

/** Fills a section with a title and its content. */
function show(id, title, stale, ...content) {
  const section = byId(id);
  const head = make('h2', title);
  if (stale) head.append(make('span', `  stale since ${time(stale)}`, 'bad'));
  section.replaceChildren(head, ...content);
  section.classList.toggle('stale', Boolean(stale));
}

/** A cell is a text, or [text, class, columns that it spans], or an element. */
function table(head, rows, kind) {
  const built = make('table', undefined, kind);
  const line = built.createTHead().insertRow();
  for (const [name, of] of head) {
    const cell = make('th', name, of);
    cell.scope = 'col';
    line.append(cell);
  }
  const body = built.createTBody();
  for (const row of rows) {
    const line = body.insertRow();
    if (row.kind) line.className = row.kind;
    for (const cell of row.cells ?? row) {
      const td = line.insertCell();
      if (cell instanceof Element) td.append(cell);
      else if (Array.isArray(cell)) [td.textContent, td.className, td.colSpan] = [cell[0], cell[1], cell[2] ?? 1];
      else td.textContent = cell;
    }
  }
  return built;
}

const words = { off: 'off', active: 'active', holding: 'holding its last value', fading: 'fading to zero', limited: 'at its limit' };

function meter(x, limit_um) {
  const size = Math.abs(x) * 1000;
  if (!isNumber(limit_um) || !isNumber(x)) return '–';
  const bar = document.createElement('meter');
  [bar.min, bar.max, bar.low, bar.high, bar.optimum, bar.value] = [0, limit_um, 0.7 * limit_um, 0.9 * limit_um, 0, size];
  const share = Math.round(100 * size / limit_um);
  bar.title = `${share} % of ${limit_um} µm`;
  const both = make('span', `${share} % `);
  both.append(bar);
  return both;
}

const draw = {
  plan(plan, test) {
    if (!plan && !test) return byId('plan').replaceChildren();
    const row = make('div', undefined, 'row');
    const bar = document.createElement('progress');
    if (plan) {
      const kind = plan.state === 'failed' ? 'state bad' : plan.state === 'done' ? 'state good' : 'state';
      row.append(make('span', plan.state, kind));
      if (plan.steps) row.append(make('span', `step ${plan.step} of ${plan.steps}`));
      row.append(make('span', plan.activity));
      if (isNumber(plan.step_left_s)) row.append(make('span', `about ${left(plan.step_left_s)} left of this step`, 'quiet'));
      if (plan.message) row.append(make('span', plan.message, 'bad'));
      const within = plan.state === 'running' ? Math.min(Math.max(plan.progress || 0, 0), 1) : 0;
      const done = plan.state === 'done' ? plan.steps : Math.max(plan.step - 1, 0) + within;
      bar.max = Math.max(plan.steps, 1);
      bar.value = done;
      bar.setAttribute('aria-label', 'steps of the plan that are done');
    }
    if (test) {
      const ended = test.completed ? 'complete' : 'not complete';
      row.append(make('span', `test ${test.kind}, run ${test.run}: ${test.is_running ? 'running' : ended}`, 'quiet'));
    }
    show('plan', 'Plan', null, row, ...(plan && plan.steps ? [bar] : []));
  },
  conditions(all) {
    const section = byId('conditions');
    if (!all) return section.replaceChildren();
    section.classList.toggle('has-error', all.some((one) => one.level === 'error'));
    section.classList.toggle('has-warning', all.length > 0 && all.every((one) => one.level !== 'error'));
    if (!all.length) return show('conditions', 'Conditions', null, make('p', 'No condition is in force.', 'good'));
    const rows = all.map((one) => [[one.name, 'text'], [one.level, one.level === 'error' ? 'text word error' : 'text word warning'], [one.message, 'text'], time(one.since_ms)]);
    show('conditions', `Conditions: ${all.length}`, null, table([['node and condition', 'text'], ['level', 'text'], ['message', 'text'], ['since']], rows));
  },
  axes(state) {
    if (!state) return byId('axes').replaceChildren();
    const hasScale = state.axes.some((one) => isNumber(one.scale));
    const head = [['axis'], ['commanded'], ['motor'], ...(hasScale ? [['scale']] : []), ['velocity /s']];
    const rows = state.axes.map((one) => [`${one.axis} ${one.unit === 'mm' ? 'mm' : '°'}`, place(one.commanded, one.unit), place(one.motor, one.unit),
      ...(hasScale ? [place(one.scale, one.unit)] : []), one.unit === 'mm' ? fixed(one.velocity, 2) : fixed(one.velocity * 180 / Math.PI, 2)]);
    show('axes', 'Axes', state.stale_since_ms, table(head, rows, 'big'));
  },
  offsets(state) {
    if (!state) return byId('offsets').replaceChildren();
    const head = [['axis'], ['applied'], ['state', 'text word'], ['of limit'], ['thermal'], ['geometric'], ['positioning']];
    const rows = state.axes.map((one) => [`${one.axis} ${one.unit === 'mm' ? 'µm' : '″'}`, small(one.total, one.unit), [words[one.state] ?? one.state, `text word ${one.state}`],
      one.unit === 'mm' ? meter(one.total, one.limit_um) : '–', small(one.thermal, one.unit), small(one.geometric, one.unit), small(one.positioning, one.unit)]);
    show('offsets', 'Offsets applied now', state.stale_since_ms, table(head, rows, 'big'));
  },
  drift(model) {
    if (!model) return byId('drift').replaceChildren();
    const head = [['axis'], ['drift µm'], ['u µm'], ['slope µm/m'], ['touched']];
    const rows = model.axes.map((one) => [one.axis, um(one.k0_mm), um(one.standard_uncertainty_mm), fixed(one.slope_mm_per_mm === null ? NaN : one.slope_mm_per_mm * 1e6, 1), time(one.measured_ms)]);
    const notes = [`model ${model.sequence} from ${model.blocks} blocks at ${time(model.at_ms)}`];
    if (model.is_over) notes.push('expired');
    if (model.quarantined) notes.push('a jump awaits a second measurement');
    const bad = model.is_over || model.quarantined;
    show('drift', 'Drift of the readings since cold', null, table(head, rows, 'big'), make('p', notes.join(', '), bad ? 'note warning' : 'note'));
  },
  temperatures(all) {
    if (!all) return byId('temperatures').replaceChildren();
    const rows = all.map((one) => ({ kind: one.stale_since_ms ? 'stale' : '', cells: [one.name, fixed(one.degc, 2), one.stale_since_ms ? [`stale since ${time(one.stale_since_ms)}`, 'bad'] : time(one.at_ms)] }));
    show('temperatures', 'Temperatures', null, table([['sensor'], ['°C'], ['at']], rows, 'big'));
  },
  touches(all) {
    if (!all) return byId('touches').replaceChildren();
    const rows = all.slice(0, 8).map((one) => one.rejected
      ? [[one.feature, 'text'], [`rejected: ${one.rejected}`, 'text warning', 4], time(one.at_ms)]
      : [[one.feature, 'text'], fixed(one.x_mm, 4), fixed(one.y_mm, 4), fixed(one.z_mm, 4), um(one.standard_uncertainty_mm), time(one.at_ms)]);
    show('touches', 'Last touches', null, table([['feature', 'text'], ['X mm'], ['Y mm'], ['Z mm'], ['u µm'], ['at']], rows));
  },
  models() {
    const rows = [];
    const { latency, geometry, rotary, positioning } = parts;
    if (latency) rows.push([['probe latency', 'text'], [`${fixed(latency.latency_s * 1000, 3)} ms, u ${fixed(latency.standard_uncertainty_s * 1000, 3)} ms, ${latency.touches} touches`, latency.negative ? 'text bad' : 'text'], time(latency.at_ms)]);
    for (const [name, model] of [['geometry', geometry], ['rotary axes', rotary]]) {
      if (model) rows.push([[name, 'text'], [`${model.components.length} components, rank ${model.rank} of ${model.unknowns}, residuals ${um(model.residual_mm)} µm`, 'text'], time(model.at_ms)]);
    }
    for (const one of positioning ?? []) {
      const unit = one.unit === 'mm' ? 'µm' : '″';
      rows.push([[`positioning ${one.axis}`, 'text'], [`${one.points} points, ${one.runs} runs, up to ${small(one.greatest, one.unit)} ${unit}`, 'text'], time(one.at_ms)]);
    }
    if (!rows.length) return byId('models').replaceChildren();
    show('models', 'Models', null, table([['model', 'text'], ['figures', 'text'], ['at']], rows));
  },
  gap(report) {
    if (!report) return byId('gap').replaceChildren();
    const closed = isNumber(report.gap_closed) ? `, ${fixed(100 * report.gap_closed, 0)} % closed` : '';
    const line = report.above_floor ? `machine minus simulator ${um(report.p95_mm)} µm (p95), noise ${um(report.floor_mm)} µm${closed}` : 'no gap above the noise';
    const rows = report.causes.map((one) => [[`${one.effect} ${one.axis}`, 'text'], one.status, `${fixed(100 * one.confidence, 0)} %`,
      [one.parameters.map((p) => `${p.name} ${Number(p.value.toPrecision(4))}`).join(', '), 'text']]);
    const content = [make('p', line)];
    if (rows.length) content.push(table([['cause', 'text'], ['status'], ['chance'], ['size', 'text']], rows));
    if (report.has_unknown) content.push(make('p', 'Part of the gap has no known cause.', 'note warning'));
    if (report.next_experiment) content.push(make('p', `next: ${report.next_experiment}`, 'note'));
    show('gap', `Gap report of ${time(report.at_ms)}`, null, ...content);
  },
  values(all) {
    if (!all) return byId('values').replaceChildren();
    const rows = all.map((one) => [[one.name, 'text'], isNumber(one.value) ? String(Number(one.value.toPrecision(6))) : one.text, [one.verdict, one.verdict === 'Good' ? '' : 'warning'], `${one.silent_s} s`]);
    show('values', 'The machine’s own values, SI', null, table([['value', 'text'], ['figure'], ['verdict'], ['silent for']], rows));
  },
  nodes(all) {
    if (!all) return byId('nodes').replaceChildren();
    const rows = all.map((one) => [[one.name, 'text'], one.stale_since_ms ? [`silent since ${time(one.stale_since_ms)}`, 'bad'] : ['alive', 'good']]);
    show('nodes', 'Nodes', null, table([['node', 'text'], ['state']], rows));
  },
  trouble(trouble) {
    if (!trouble) return byId('trouble').replaceChildren();
    const rows = trouble.refused.map((one) => [[one.topic, 'text'], String(one.messages), [one.reason, 'text']]);
    const content = rows.length ? [table([['topic', 'text'], ['messages'], ['reason', 'text']], rows)] : [];
    if (trouble.left_out) content.push(make('p', `${trouble.left_out} messages or names were dropped: too many at once`, 'note warning'));
    show('trouble', 'Not shown', null, ...content);
  },
};

/** The server's time and, in a simulated run, that of the cell. */
function clock() {
  const date = (at) => new Date(at).toLocaleString('sv-SE');
  const cell = parts.axes?.at_ms;
  const isOther = isNumber(cell) && Math.abs(cell - newest) > 3600e3;
  return isOther ? `simulated ${date(cell)}, now ${date(newest)}` : date(newest);
}

/** Section of each part with another name. */
const inSection = { plan: 'plan', test: 'plan', latency: 'models', geometry: 'models', rotary: 'models', positioning: 'models' };

function redraw(changed) {
  for (const id of new Set(changed.map((part) => inSection[part] ?? part))) {
    if (id === 'plan') draw.plan(parts.plan, parts.test);
    else draw[id]?.(parts[id]);
  }
}

function setLink(kind, text) {
  const link = byId('link');
  if (link.textContent !== text) link.textContent = text;
  link.className = kind;
  isCut = kind === 'cut';
  document.body.classList.toggle('cut', isCut);
}

/** The server's reason for no events. */
async function why() {
  try {
    const answer = await fetch('snapshot.json' + query);
    return answer.ok ? null : (await answer.text()).trim();
  } catch {
    return null;
  }
}

function listen() {
  const events = new EventSource('events' + query);
  let isFirst = true;
  events.onopen = () => { isFirst = true; };
  events.onmessage = (event) => {
    const update = JSON.parse(event.data);
    [newest, received] = [update.now_ms, performance.now()];
    const gone = isFirst ? Object.keys(parts) : [];
    for (const part of gone) delete parts[part];
    Object.assign(parts, update.parts);
    isFirst = false;
    redraw([...gone, ...Object.keys(update.parts)]);
    byId('clock').textContent = clock();
    setLink('live', 'live');
  };
  events.onerror = async () => {
    if (events.readyState !== EventSource.CLOSED) return;
    const reason = await why();
    if (reason) setLink('cut', reason);
    setTimeout(listen, 5000);
  };
}

setInterval(() => {
  const silent_s = (performance.now() - received) / 1000;
  if (silent_s < 3 || (isCut && !byId('link').textContent.startsWith('stale'))) return;
  setLink('cut', newest ? `stale since ${time(Date.now() - 1000 * silent_s)}` : 'no answer from the server');
}, 500);

byId('snapshot').href = 'snapshot.json' + query;
listen();
