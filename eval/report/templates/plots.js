"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const isNarrow = () => window.matchMedia("(max-width: 760px)").matches;
const kindNamed = Object.fromEntries(data.kinds.map((kind) => [kind.name, kind]));
const seconds = (t) => `${t.toFixed(1)} s`;

function axis(title, more) {
  return Object.assign(
    {
      title: {text: title, standoff: 8},
      gridcolor: "#e6e6e6",
      linecolor: "#999999",
      zeroline: false,
      showline: true,
      automargin: true,
    },
    more,
  );
}

function layout(across, up, more) {
  return Object.assign(
    {
      xaxis: across,
      yaxis: up,
      font: {family: 'system-ui, "Segoe UI", "DejaVu Sans", sans-serif', size: 12, color: "#333333"},
      margin: {l: 56, r: 14, t: 14, b: 44},
      legend: {orientation: "h", y: -0.16, yanchor: "top", x: 0},
      hovermode: "closest",
      dragmode: isNarrow() ? false : "zoom",
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
    },
    more,
  );
}

const options = {
  responsive: true,
  displaylogo: false,
  displayModeBar: matchMedia("(hover: hover)").matches ? "hover" : false,
  modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
};

function curve(line, hover) {
  return {
    name: line.name,
    x: line.x,
    y: line.y,
    customdata: line.t,
    mode: "lines",
    line: {color: line.color, dash: line.dash, width: line.width},
    hovertemplate: hover,
  };
}

function candidatesOf(kind) {
  return data.candidates.map((loop, index) => ({loop, index})).filter(({loop}) => loop.kind === kind.name);
}

/* Links of one kind, from query to match and then a gap; each point knows its candidate. */
function links(kind) {
  const x = [], y = [], customdata = [], text = [];
  const shown = candidatesOf(kind);
  for (const {loop, index} of shown) {
    for (const end of loop.ends) {
      x.push(end[0]);
      y.push(end[1]);
      customdata.push(index);
      text.push(`${loop.query} → ${loop.match}`);
    }
    x.push(null);
    y.push(null);
    customdata.push(null);
    text.push("");
  }
  const isCrowded = shown.length > 40 && kind.name !== "false";
  const look = {
    name: `${kind.label} (${kind.count})`,
    legendgroup: kind.name,
    mode: "lines+markers",
    line: {color: kind.color, dash: kind.dash, width: isCrowded ? 0.8 : 1.6},
    marker: {size: isCrowded ? 4 : 6, color: kind.color},
  };
  const opacity = isCrowded ? Math.min(0.35, Math.max(0.12, 30 / shown.length)) : 0.9;
  const hovertemplate = `%{text}<extra>${kind.label}</extra>`;
  /* The legend's entry is a trace of its own, which does not fade. */
  return [{...look, x: [null], y: [null]}, {...look, x, y, customdata, text, opacity, hovertemplate, showlegend: false}];
}

function drawView(open) {
  const loops = data.kinds.filter((kind) => kind.in_graph).flatMap(links);
  const paths = data.view.lines.map((line) =>
    curve(line, `%{x:.2f}, %{y:.2f} m at %{customdata:.1f} s<extra>${line.name}</extra>`));
  const up = axis(data.view.up, {scaleanchor: "x", scaleratio: 1});
  const plot = document.getElementById("view");
  Plotly.newPlot(plot, [...loops, ...paths], layout(axis(data.view.across), up), options);
  plot.on("plotly_click", (event) => {
    const index = event.points[0].data.mode === "lines" ? null : event.points[0].customdata;
    if (index !== null && open) open(index);
  });
}

function drawErrors() {
  const plot = document.getElementById("errors");
  if (!plot) return;
  const traces = data.errors.map((line) => curve(line, `%{y:.1f} cm at %{x:.1f} s<extra>${line.name}</extra>`));
  const up = axis(data.errorTitle, {rangemode: "tozero"});
  Plotly.newPlot(plot, traces, layout(axis("time [s]", {range: [0, data.duration]}), up), options);
}

drawView((index) => window.dispatchEvent(new CustomEvent("candidate", {detail: index})));
drawErrors();
