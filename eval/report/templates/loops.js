"use strict";
const PAGE = 100;
const SVG = "http://www.w3.org/2000/svg";
const COLUMNS = [
  {title: "loop", value: (loop) => loop.query, text: (loop) => `${loop.query} → ${loop.match}`},
  {title: "time", value: (loop) => loop.times[0], text: (loop) => `${seconds(loop.times[0])} → ${seconds(loop.times[1])}`, wide: true},
  {title: "detector", value: (loop) => loop.detector, text: (loop) => loop.detector, wide: true},
  {title: "score", value: (loop) => loop.score, text: (loop) => loop.score.toFixed(3)},
  {title: "outcome", value: (loop) => data.kinds.findIndex((kind) => kind.name === loop.kind), badge: true},
  {title: "reason", value: (loop) => loop.reason, text: (loop) => loop.reason, wide: true},
  {title: "inliers", value: (loop) => loop.inliers, text: (loop) => loop.inliers ?? "", wide: true},
  {title: "error", value: (loop) => loop.error, text: (loop) => (loop.error === null ? "" : `${loop.error.toFixed(1)} cm`)},
];
const NODE_COLORS = ["#009e73", "#e69f00", "#56b4e9", "#f0e442", "#d55e00", "#cc79a7"];
const SYMBOLS = {true: "circle", accepted: "circle", inaccurate: "square", false: "x", withdrawn: "triangle-down", rejected: "x-thin-open", skipped: "circle-open"};
const $ = (id) => document.getElementById(id);
const table = {order: 0, ascending: true, shown: PAGE, rows: []};

function element(name, properties, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

function badge(kind) {
  const made = element("span", {className: "badge", textContent: kind.name});
  made.style.setProperty("--kind", kind.color);
  return made;
}

const reasonName = (loop) => loop.reason.split(":")[0];

function passes(loop) {
  const form = $("filters").elements;
  return (!form.kind.value || loop.kind === form.kind.value)
    && (!form.reason.value || reasonName(loop) === form.reason.value)
    && (!form.detector.value || loop.detector === form.detector.value)
    && loop.score >= Number(form.least.value || 0)
    && loop.score <= Number(form.most.value || 1);
}

/* Empty values last, in whichever direction. */
function compare(a, b) {
  const value = COLUMNS[table.order].value;
  const [x, y] = [value(data.candidates[a]), value(data.candidates[b])];
  const isEmpty = [x, y].map((v) => v === null || v === "");
  if (isEmpty[0] || isEmpty[1]) return isEmpty[0] - isEmpty[1] || a - b;
  const order = x < y ? -1 : x > y ? 1 : 0;
  return (table.ascending ? order : -order) || a - b;
}

function row(index) {
  const loop = data.candidates[index];
  const cells = COLUMNS.map((column) =>
    element("td", {className: column.wide ? "wide" : ""}, column.badge ? badge(kindNamed[loop.kind]) : column.text(loop)));
  const made = element("tr", {tabIndex: 0}, ...cells);
  made.dataset.index = index;
  return made;
}

function fillTable() {
  table.rows = data.candidates.map((_, index) => index).filter((index) => passes(data.candidates[index])).sort(compare);
  $("loops").tBodies[0].replaceChildren(...table.rows.slice(0, table.shown).map(row));
  $("count").textContent = `${table.rows.length} of ${data.candidates.length} candidates`;
  $("more").hidden = table.rows.length <= table.shown;
  $("more").textContent = `Show more (${table.rows.length - table.shown} left)`;
  [...$("loops").tHead.rows[0].cells].forEach((cell, at) => {
    if (at === table.order) cell.setAttribute("aria-sort", table.ascending ? "ascending" : "descending");
    else cell.removeAttribute("aria-sort");
  });
}

function sortBy(at) {
  table.ascending = at === table.order ? !table.ascending : true;
  table.order = at;
  fillTable();
}

function prepareTable() {
  COLUMNS.forEach((column, at) => {
    const button = element("button", {type: "button", textContent: column.title, onclick: () => sortBy(at)});
    $("loops").tHead.rows[0].append(element("th", {className: column.wide ? "wide" : "", scope: "col"}, button));
  });
  const choices = {
    kind: data.kinds.map((kind) => kind.name),
    reason: [...new Set(data.candidates.map(reasonName))].filter(Boolean).sort(),
    detector: [...new Set(data.candidates.map((loop) => loop.detector))].sort(),
  };
  for (const [name, values] of Object.entries(choices)) {
    $("filters").elements[name].append(...values.map((value) => element("option", {value, textContent: value})));
  }
  $("filters").addEventListener("input", () => { table.shown = PAGE; fillTable(); });
  $("filters").addEventListener("submit", (event) => event.preventDefault());
  $("more").onclick = () => { table.shown += PAGE; fillTable(); };
  const open = (event) => { const found = event.target.closest("tr"); if (found) show(Number(found.dataset.index)); };
  $("loops").tBodies[0].addEventListener("click", open);
  $("loops").tBodies[0].addEventListener("keydown", (event) => { if (event.key === "Enter") open(event); });
  fillTable();
}

function shape(name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

/* Both frames in one drawing whose unit is a pixel of the original: side by side, or one above the other. */
function drawPictures(loop) {
  const [query, match] = [data.images[loop.query], data.images[loop.match]];
  const known = Boolean(query && match);
  for (const id of ["pictures", "toggles", "legend"]) $(id).toggleAttribute("hidden", !known);
  $("no-pictures").hidden = known;
  if (!known) return;
  const gap = query.width / 60;
  const offset = isNarrow() ? [0, query.height + gap] : [query.width + gap, 0];
  const size = isNarrow() ? [query.width, query.height + gap + match.height] : [query.width + gap + match.width, query.height];
  const parts = [];
  const wanted = Object.fromEntries([...$("toggles").querySelectorAll("input")].map((box) => [box.name, box.checked]));
  for (const [image, [x, y]] of [[query, [0, 0]], [match, offset]]) {
    const place = {x, y, width: image.width, height: image.height, preserveAspectRatio: "none"};
    parts.push(shape("image", {...place, href: image.image}));
    if (wanted.masks && image.mask) parts.push(shape("image", {...place, href: image.mask, opacity: 0.6}));
  }
  const unit = query.width / 160;
  if (wanted.matches) {
    for (const [u, v, s, t] of loop.matches) {
      const [x, y] = [s + offset[0], t + offset[1]];
      parts.push(shape("line", {x1: u, y1: v, x2: x, y2: y, stroke: "#f0e442", "stroke-width": unit / 5, opacity: 0.55}));
      for (const [cx, cy] of [[u, v], [x, y]]) parts.push(shape("circle", {cx, cy, r: unit * 0.7, fill: "#f0e442"}));
    }
  }
  if (wanted.nodes) loop.nodes.forEach((node, at) => parts.push(...drawNode(node, NODE_COLORS[at % NODE_COLORS.length], offset, unit)));
  $("pictures").setAttribute("viewBox", `0 0 ${size[0]} ${size[1]}`);
  $("pictures").replaceChildren(...parts);
  drawLegend(query, match);
}

function drawNode([label, u, v, s, t], color, offset, unit) {
  const [x, y] = [s + offset[0], t + offset[1]];
  const text = {"font-size": 4.2 * unit, "paint-order": "stroke", stroke: "#000", "stroke-width": unit * 0.8, fill: color};
  return [
    shape("line", {x1: u, y1: v, x2: x, y2: y, stroke: color, "stroke-width": unit / 2.5}),
    ...[[u, v], [x, y]].flatMap(([cx, cy]) => [
      shape("circle", {cx, cy, r: unit * 1.5, fill: color, stroke: "#fff", "stroke-width": unit / 2}),
      shape("text", {x: cx + 2 * unit, y: cy - 1.5 * unit, ...text}, label),
    ]),
  ];
}

function drawLegend(query, match) {
  const shares = new Map();
  for (const label of [...query.labels, ...match.labels]) {
    const before = shares.get(label.name);
    shares.set(label.name, {...label, share: Math.max(label.share, before ? before.share : 0)});
  }
  const labels = [...shares.values()].sort((a, b) => b.share - a.share).slice(0, 12);
  $("legend").replaceChildren(...labels.map((label) => {
    const made = element("span", {textContent: label.name});
    made.style.setProperty("--kind", label.color);
    return made;
  }));
}

function drawToggles(loop) {
  const [query, match] = [data.images[loop.query], data.images[loop.match]];
  const has = {masks: Boolean(query?.mask && match?.mask), nodes: loop.nodes.length > 0, matches: loop.matches.length > 0};
  for (const box of $("toggles").querySelectorAll("input")) box.parentElement.hidden = !has[box.name];
  $("legend").hidden ||= !has.masks || !$("toggles").querySelector("[name=masks]").checked;
}

function group([title, values]) {
  const rows = values.map(([name, value]) =>
    element("div", {}, element("dt", {textContent: name}), element("dd", {textContent: value})));
  return element("section", {style: "margin: 0"}, element("h3", {textContent: title}), element("dl", {}, ...rows));
}

let current = 0;

function show(index) {
  current = index;
  const loop = data.candidates[index];
  $("loop-title").textContent = `Keyframes ${loop.query} → ${loop.match}`;
  const said = `${seconds(loop.times[0])} → ${seconds(loop.times[1])}, score ${loop.score.toFixed(3)}`;
  $("loop-reason").replaceChildren(badge(kindNamed[loop.kind]), ` ${loop.reason ? `${loop.reason}; ` : ""}${said}`);
  drawPictures(loop);
  drawToggles(loop);
  $("values").replaceChildren(...loop.groups.map(group));
  const at = table.rows.indexOf(index);
  $("previous").disabled = at <= 0;
  $("next").disabled = at < 0 || at === table.rows.length - 1;
  if (!$("loop").open) $("loop").showModal();
}

function step(by) {
  const next = table.rows[table.rows.indexOf(current) + by];
  if (next !== undefined) show(next);
}

function prepareDialog() {
  $("previous").onclick = () => step(-1);
  $("next").onclick = () => step(1);
  $("close").onclick = () => $("loop").close();
  $("loop").addEventListener("click", (event) => { if (event.target === $("loop")) $("loop").close(); });
  $("loop").addEventListener("keydown", (event) => {
    if (event.key === "ArrowLeft") step(-1);
    if (event.key === "ArrowRight") step(1);
  });
  $("toggles").addEventListener("input", () => show(current));
  window.addEventListener("resize", () => { if ($("loop").open) show(current); });
  window.addEventListener("candidate", (event) => show(event.detail));
}

function drawTimeline() {
  const traces = [...data.kinds].reverse().map((kind) => {
    const shown = candidatesOf(kind);
    return {
      name: `${kind.label} (${kind.count})`,
      x: shown.map(({loop}) => loop.times[0]),
      y: shown.map(({loop}) => loop.times[1]),
      customdata: shown.map(({index}) => index),
      text: shown.map(({loop}) => `${loop.query} → ${loop.match}${loop.reason ? `<br>${loop.reason}` : ""}`),
      mode: "markers",
      marker: {color: kind.color, size: ["rejected", "skipped"].includes(kind.name) ? 5 : 7, symbol: SYMBOLS[kind.name], opacity: 0.8},
      hovertemplate: `%{text}<extra>${kind.label}</extra>`,
    };
  });
  const diagonal = {
    x: [0, data.duration], y: [0, data.duration], mode: "lines", hoverinfo: "skip", showlegend: false,
    line: {color: "#bbbbbb", width: 1, dash: "dot"},
  };
  const plot = $("timeline");
  const across = axis("time of the query [s]"), up = axis("time of the match [s]");
  Plotly.newPlot(plot, [diagonal, ...traces], layout(across, up, {legend: {x: 0.01, y: 0.99, traceorder: "reversed", bgcolor: "#fffc"}}), options);
  plot.on("plotly_click", (event) => show(event.points[0].customdata));
}

drawTimeline();
prepareDialog();
if (data.candidates.length) prepareTable();
