"use strict";
(() => {
  const data = JSON.parse(document.getElementById("flight").textContent);
  const $ = (id) => document.getElementById(id);
  const style = getComputedStyle(document.documentElement);
  const color = (name) => style.getPropertyValue("--" + name).trim();
  const words = (name) => name.replaceAll("_", " ");
  const PAINTS = [...["ink", "accent", "executive", "autopilot", "wind", "perception"].map(color), "#84a80d", "#b9770e", "#d13fe0", "#22a7c9"];
  const paint = (k) => PAINTS[k] ?? `hsl(${Math.round(k * 137.5) % 360} 60% 50%)`; // each flight has its own, however many there are
  const took = (v) => (v === null ? "–" : `${v.toFixed(1)} s`);
  const TONES = { completed: "ok", failed: "failed", unfinished: "failed" };

  function make(tag, text, name) {
    const element = document.createElement(tag);
    if (text !== undefined) element.textContent = text;
    if (name) element.className = name;
    return element;
  }

  function swatch(k) {
    const mark = make("i", undefined, "swatch");
    mark.style.background = paint(k);
    return mark;
  }

  /** A table; `numbers` says from which column on cells are numbers, at the right. */
  function table(place, head, rows, numbers = 1) {
    const body = make("table"), first = make("tr");
    head.forEach((cell, k) => {
      const one = make("th", typeof cell === "string" ? cell : undefined, k >= numbers ? "num" : "");
      if (typeof cell !== "string") one.append(...cell);
      first.append(one);
    });
    body.append(first);
    for (const row of rows) {
      const line = make("tr");
      row.forEach((cell, k) => line.append(make("td", cell, k >= numbers ? "num" : "")));
      body.append(line);
    }
    const box = make("div", undefined, "scroll");
    box.append(body);
    place.append(box);
  }

  const number = (k) => [swatch(k), String(k + 1)];
  const numbered = () => data.names.map((_, k) => number(k));
  const axis = (more) => ({ gridcolor: color("grid"), zerolinecolor: color("grid"), automargin: true, ...more });
  const layout = (more) => ({
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: color("ink"), size: 12, family: "system-ui, sans-serif" },
    margin: { l: 46, r: 12, t: 8, b: 34 }, showlegend: false, hoverlabel: { bgcolor: color("card"), font: { color: color("ink") } }, ...more,
  });
  const CONFIG = { displaylogo: false, responsive: true, displayModeBar: false };

  function flights() {
    const list = make("ol", undefined, "flights");
    data.names.forEach((name, k) => {
      const item = make("li");
      item.append(swatch(k), make("b", String(k + 1)), make("span", name), make("span", data.headlines[k], TONES[data.results[k]] ?? "warning"), make("span", data.reasons[k], "dim"));
      list.append(item);
    });
    $("flights").append(list);
    if (data.differing.length) {
      $("flights").append(make("h2", "What they were flown with differs"));
      table($("flights"), ["", ...numbered()], data.differing, Infinity);
      if (data.n_not_shown) $("flights").append(make("p", `${data.n_not_shown} more differ: compare --json tells them all.`, "dim"));
    }
    if (data.alike.length) $("flights").append(make("p", `${data.differing.length ? "Otherwise the" : "The"} same for all: ${data.alike.join(", ")}.`, "dim"));
  }

  flights();
  const changes = data.names.slice(1).map((_, k) => (data.names.length === 2 ? "change" : `change ${k + 2}`));
  if (data.names.length > 3) document.querySelector("main").classList.add("many");
  $("figures").append(make("h2", "Figures"));
  table($("figures"), ["", ...numbered(), ...changes], data.figure_rows);
  data.tasks.forEach((pairs, other) => {
    $("tasktable").append(make("h2", data.tasks.length > 1 ? `Tasks: 1 and ${other + 2}` : "Tasks"));
    table($("tasktable"), ["", number(0), number(other + 1), "1 took", `${other + 2} took`],
      pairs.map((task) => [words(task.task), ...task.results.map((r) => (r === null ? "not flown" : words(r))), ...task.took_s.map(took)]), 3);
  });
  if (data.lines.length > 1) {
    const told = data.lines.map(({ flights: these }, k) => `${these.map((one) => one + 1).join(", ")} along ${k ? "another" : "one"}`);
    $("mapnote").textContent = `They flew along different lines (${told.join("; ")}): each is drawn from its own flight's origin, and where they cross here says nothing.`;
    $("mapnote").hidden = false;
  }
  const legend = (name, style) => {
    const entry = make("span"), mark = make("i");
    mark.style.cssText = style;
    entry.append(mark, name);
    $("maplegend").append(entry);
  };

  addEventListener("DOMContentLoaded", () => requestAnimationFrame(() => setTimeout(() => {
    document.head.append(make("script", $("plotly").textContent));
    const traces = [];
    data.lines.forEach(({ flights: these, conductors, supports }) => {
      const isShared = data.lines.length === 1, hue = isShared ? color("line") : paint(these[0]), whose = isShared ? "" : ` of ${these.map((k) => k + 1).join(" and ")}`;
      for (const points of conductors) traces.push({ type: "scatter", mode: "lines", hoverinfo: "skip", name: "conductor", x: points.map((p) => p[1]), y: points.map((p) => p[0]), opacity: isShared ? 1 : 0.5, line: { color: hue, width: 1 } });
      traces.push({ type: "scatter", mode: "markers", hoverinfo: "skip", name: "supports", x: supports.map((p) => p[1]), y: supports.map((p) => p[0]), marker: { color: hue, size: 7, symbol: "square" } });
      legend(`conductors${whose}`, `height:2px;background:${hue}`);
      legend(`supports${whose}`, `width:8px;height:8px;background:${hue}`);
    });
    data.names.forEach((_, k) => legend(`flight ${k + 1}`, `height:4px;background:${paint(k)}`));
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
      const title = make("h2", `${leg.title} [m]`);
      for (const curve of leg.curves) { const of = make("span", undefined, "key"); of.append(swatch(curve.flight), String(curve.flight + 1)); title.append(of); }
      card.append(title, plot);
      $("charts").append(card);
      draws.push(() => Plotly.newPlot(plot, leg.curves.map((curve) => ({ type: "scatter", mode: "lines", name: data.names[curve.flight], x: curve.t, y: curve.y, line: { color: paint(curve.flight), width: 1.5 } })),
        layout({ xaxis: axis({ ticksuffix: " s" }), yaxis: axis({}), hovermode: "x" }), CONFIG));
    }
    for (const draw of draws) draw(); // once all cards stand, and have their widths
    document.body.dataset.ready = "yes";
  })));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => location.reload());
})();
