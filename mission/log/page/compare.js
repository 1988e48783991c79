"use strict";
(() => {
  const data = JSON.parse(document.getElementById("flight").textContent);
  const $ = (id) => document.getElementById(id);
  const style = getComputedStyle(document.documentElement);
  const color = (name) => style.getPropertyValue("--" + name).trim();
  const words = (name) => name.replaceAll("_", " ");
  const PAINTS = ["ink", "accent", "executive", "autopilot", "wind", "perception"].map(color);
  const paint = (k) => PAINTS[k % PAINTS.length];
  const number = (v) => (v === null ? "–" : Math.abs(v) >= 100 ? v.toFixed(0) : v.toPrecision(3));

  function make(tag, text, name) {
    const element = document.createElement(tag);
    if (text !== undefined) element.textContent = text;
    if (name) element.className = name;
    return element;
  }

  function table(id, title, head, rows) {
    const body = make("table");
    const first = make("tr");
    head.forEach((cell, k) => first.append(make("th", cell, k ? "num" : "")));
    body.append(first);
    for (const row of rows) {
      const line = make("tr");
      row.forEach((cell, k) => line.append(make("td", cell, k ? "num" : "")));
      body.append(line);
    }
    $(id).append(make("h2", title), body);
  }

  const axis = (more) => ({ gridcolor: color("grid"), zerolinecolor: color("grid"), automargin: true, ...more });
  const layout = (more) => ({
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: color("ink"), size: 12, family: "system-ui, sans-serif" },
    margin: { l: 46, r: 12, t: 8, b: 34 }, showlegend: false, hoverlabel: { bgcolor: color("card"), font: { color: color("ink") } }, ...more,
  });
  const CONFIG = { displaylogo: false, responsive: true, displayModeBar: false };

  data.names.forEach((name, k) => {
    const swatch = make("i");
    swatch.style.cssText = `display:inline-block;width:16px;height:4px;margin:0 6px 3px ${k ? 18 : 0}px;background:${paint(k)}`;
    $("legend").append(swatch, `${name} (${words(data.results[k])})`);
  });
  const changes = data.names.slice(1).map((_, k) => (data.names.length === 2 ? "change" : `change ${k + 2}`));
  table("figures", "Figures", ["", ...data.names.map((_, k) => String(k + 1)), ...changes],
    Object.entries(data.figures).filter(([, values]) => values.some((v) => v !== null)).map(([name, values]) => [words(name), ...values.map(number), ...data.changes[name].map((v) => (v > 0 ? "+" : "") + number(v))]));
  table("tasktable", "Tasks", ["", "1 took [s]", "other took [s]", "1", "other"],
    data.tasks.flat().map((task) => [words(task.task), ...task.took_s.map(number), ...task.results.map((r) => (r === null ? "not flown" : words(r)))]));

  addEventListener("DOMContentLoaded", () => requestAnimationFrame(() => setTimeout(() => {
    document.head.append(make("script", $("plotly").textContent));
    const traces = [];
    for (const conductor of data.conductors) traces.push({ type: "scatter", mode: "lines", hoverinfo: "skip", name: "conductor", x: conductor.map((p) => p[1]), y: conductor.map((p) => p[0]), line: { color: color("line"), width: 1 } });
    const box = [Infinity, -Infinity, Infinity, -Infinity];
    data.tracks.forEach((track, k) => {
      traces.push({ type: "scatter", mode: "lines", name: data.names[k], hoverinfo: "name", x: track.east, y: track.north, line: { color: paint(k), width: 2 } });
      for (const e of track.east) if (e !== null) { box[0] = Math.min(box[0], e); box[1] = Math.max(box[1], e); }
      for (const n of track.north) if (n !== null) { box[2] = Math.min(box[2], n); box[3] = Math.max(box[3], n); }
    });
    const pad = Math.max(5, 0.1 * Math.max(box[1] - box[0], box[3] - box[2]));
    Plotly.newPlot("map", traces, layout({
      xaxis: axis({ title: { text: "east [m]" }, range: [box[0] - pad, box[1] + pad] }),
      yaxis: axis({ title: { text: "north [m]" }, range: [box[2] - pad, box[3] + pad], scaleanchor: "x" }), dragmode: "pan", hovermode: "closest",
    }), { ...CONFIG, scrollZoom: true });
    const draws = [];
    for (const leg of data.legs) {
      const card = make("div", undefined, "card chart"), plot = make("div", undefined, "plot");
      card.append(make("h2", `${leg.title} [m]`), plot);
      $("charts").append(card);
      draws.push(() => Plotly.newPlot(plot, leg.curves.map((curve) => ({ type: "scatter", mode: "lines", name: data.names[curve.flight], x: curve.t, y: curve.y, line: { color: paint(curve.flight), width: 1.5 } })),
        layout({ xaxis: axis({ ticksuffix: " s" }), yaxis: axis({}), hovermode: "x" }), CONFIG));
    }
    for (const draw of draws) draw(); // once all cards stand, and have their widths
    document.body.dataset.ready = "yes";
  })));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => location.reload());
})();
