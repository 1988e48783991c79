"use strict";
(() => {
  const flight = JSON.parse(document.getElementById("flight").textContent);
  const report = flight.report;
  const $ = (id) => document.getElementById(id);
  const style = getComputedStyle(document.documentElement);
  const color = (name) => style.getPropertyValue("--" + name).trim();
  const words = (name) => name.replaceAll("_", " ");
  const TASKS = {
    takeoff: "#cbd5e1", ascend: "#bae6fd", move_until: "#7dd3fc", align: "#f0abfc", follow_lines: "#fbbf24",
    rotate: "#fca5a5", move_forward: "#a3e635", return: "#86efac", descend: "#bef264", land: "#d6d3d1", hold: "#ddd6fe",
  };
  const CULPRITS = ["perception", "executive", "autopilot", "wind"];
  const T0 = Math.min(0, flight.track.t[0] ?? 0);
  const T1 = Math.max(report.duration_s, flight.track.t.at(-1) ?? 0);
  /** What was flown outside the tasks, and the time before the first of them. */
  const STAGES = [...(T0 < -0.5 ? [{ name: `before ${flight.times_since}`, start_s: T0, end_s: 0 }] : []), ...report.stages.filter((stage) => stage.start_s >= 0)];
  let now = 0;
  let playing = null;

  function make(tag, attributes = {}, ...children) {
    const element = document.createElement(tag);
    for (const [key, value] of Object.entries(attributes)) {
      if (key === "class") element.className = value;
      else if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
      else element.setAttribute(key, value);
    }
    element.append(...children.filter((child) => child !== null && child !== undefined));
    return element;
  }

  /** The last index whose time is not after t; -1 before the first. */
  function indexAt(times, t) {
    let low = 0, high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle + 1; else high = middle;
    }
    return low - 1;
  }

  function nearest(times, t) {
    const before = indexAt(times, t);
    if (before < 0) return times.length ? 0 : -1;
    if (before + 1 < times.length && times[before + 1] - t < t - times[before]) return before + 1;
    return before;
  }

  const clock = (t) => {
    const sign = t < 0 ? "-" : "", all = Math.abs(t);
    return `${sign}${Math.floor(all / 60)}:${(all % 60).toFixed(1).padStart(4, "0")}`;
  };
  const fixed = (value, digits, unit) => (value === null || value === undefined ? "–" : (value.toFixed(digits).replace(/^-(?=[0.]*$)/, "") + unit));
  const counted = (n, noun) => `${n} ${noun}${n === 1 ? "" : "s"}`;
  const withUnit = (value, unit) => (unit === "deg" ? fixed(value, value < 10 ? 1 : 0, "°") : fixed(value, 2, ` ${unit}`));

  // -- heading and blame -------------------------------------------------------------------------------------------

  function heading() {
    $("name").textContent = flight.name;
    const isHurt = report.events.some((event) => event.severity === "error"); // it may have fallen over after a mission that it completed
    const tone = { completed: isHurt ? "warn" : "good", failed: "bad", unfinished: "bad" }[report.result] ?? "warn";
    $("result").textContent = flight.headline;
    $("result").classList.add(tone);
    $("reason").textContent = report.reason;
    $("damage").textContent = report.damage ?? "";
    $("damage").hidden = !report.damage;
    $("begun").textContent = `${flight.begun} · ${counted(report.tasks.length, "task")} · ${clock(report.duration_s)} min · times from ${flight.times_since}`;
    $("log").textContent = flight.log;
    $("mission").textContent = flight.mission_text;
    const tiles = [];
    if (report.lateral) {
      tiles.push([`${report.lateral.mean_m.toFixed(2)} m`, "from the true line, mean"]);
      tiles.push([`${report.lateral.p95_m.toFixed(2)} m`, "from the true line, p95"]);
    } else if (report.legs.length) tiles.push([`${report.legs[0].avg_error_m.toFixed(2)} m`, "off straight, mean of leg 1"]);
    if (report.yaw_error) tiles.push([`${report.yaw_error.median_deg.toFixed(1)}°`, "heading error, median"]);
    if (report.vision.latency_ms) tiles.push([`${report.vision.latency_ms.p50.toFixed(0)} ms`, "frame to estimate, median"]);
    if (report.landing) {
      const where = report.is_truncated ? "from the start, where the log ends" : report.landing.is_disarmed ? (report.result === "completed" && !isHurt ? "landed from the start" : "from the start, at the end") : "from the start, still armed";
      tiles.push([`${report.landing.distance_m.toFixed(2)} m`, where]);
    }
    for (const [figure, what] of tiles) $("tiles").append(make("div", { class: "tile" }, make("b", {}, figure), make("span", {}, what)));
  }

  const KINDS = {
    off_line: "Off the line", unseen: "The line unseen", misdated: "Frames with wrong times", off_height: "Off its height",
    off_heading: "Off its heading", tilted: "Leaning as far as it may",
  };

  const PARTS = {
    perception: "the camera's line beside the real one", executive: "the setpoint beside the camera's line",
    tracking: "the vehicle beside its setpoint",
  };

  function blame() {
    for (const trouble of report.excursions) {
      const total = Object.values(trouble.shares).filter((v) => v > 0).reduce((a, b) => a + b, 0);
      const shares = total ? make("div", { class: "shares", "aria-hidden": "true" }, ...Object.entries(trouble.shares)
        .filter(([, value]) => value > 0)
        .map(([who, value]) => {
          const part = make("i", { title: `${PARTS[who] ?? who}: ${withUnit(value, trouble.unit)}` });
          part.style.flex = value / total;
          part.style.background = color(who === "tracking" ? trouble.culprit === "wind" ? "wind" : "autopilot" : who);
          return part;
        })) : null;
      $("blame").append(make("button", { type: "button", class: `card fault ${trouble.culprit}`, onclick: () => setTime(trouble.start_s) },
        make("h2", {}, `${KINDS[trouble.kind] ?? words(trouble.kind)}, ${withUnit(trouble.peak, trouble.unit)}`,
          make("span", { class: "who" }, `${trouble.culprit} · ${trouble.fault}`),
          make("span", { class: "dim" }, `${clock(trouble.start_s)} to ${clock(trouble.end_s)}`)),
        shares,
        make("ul", {}, ...trouble.evidence.map((line) => make("li", {}, line)))));
    }
    if (!report.excursions.length && report.result === "completed" && report.tasks.some((task) => task.task === "follow_lines")) {
      $("blame").append(make("p", { class: "dim" }, `Nothing went beyond its limits while the line was followed${report.damage ? ", in what the log still holds" : ""}.`));
    }
  }

  // -- timeline ----------------------------------------------------------------------------------------------------

  const share = (t) => `${(100 * (t - T0)) / Math.max(T1 - T0, 1e-6)}%`;

  function timeline() {
    for (const task of report.tasks) {
      const end = task.end_s ?? T1;
      const box = make("div", { class: "task", title: `${words(task.task)}: ${task.reason}` }, words(task.task));
      box.style.left = share(task.start_s);
      box.style.width = `calc(${share(T0 + end - task.start_s)})`;
      box.style.background = TASKS[task.task] ?? "#e5e7eb";
      $("tasks").append(box);
    }
    for (const stage of STAGES) {
      const box = make("div", { class: "task stage-out", title: `${stage.name}: outside the mission's tasks` }, make("b", {}, stage.name));
      box.style.left = share(stage.start_s);
      box.style.width = share(T0 + stage.end_s - stage.start_s);
      $("tasks").append(box);
    }
    const boxes = [...$("tasks").children];
    const fit = () => { // a name that is cut off says less than none
      for (const box of boxes) box.classList.remove("tight");
      const tight = boxes.filter((box) => box.scrollWidth > box.clientWidth);
      for (const box of tight) box.classList.add("tight");
    };
    requestAnimationFrame(fit);
    addEventListener("resize", fit);
    for (const trouble of report.excursions) {
      const mark = make("div", { class: "mark", title: `${words(trouble.kind)}: ${trouble.culprit}` });
      mark.style.left = share(trouble.start_s);
      mark.style.width = share(T0 + trouble.end_s - trouble.start_s);
      mark.style.background = color(trouble.culprit);
      $("marks").append(mark);
    }
    for (const event of report.events) {
      const mark = make("div", { class: "event", title: `${words(event.name)}: ${event.message}` });
      mark.style.left = share(event.t_s);
      $("marks").append(mark);
    }
    const slider = $("slider");
    Object.assign(slider, { min: T0, max: T1, step: 0.05, value: 0 });
    slider.addEventListener("input", () => { stop(); setTime(Number(slider.value)); });
    $("bar").addEventListener("click", (event) => {
      const box = $("bar").getBoundingClientRect();
      setTime(T0 + ((event.clientX - box.left) / box.width) * (T1 - T0));
    });
    $("play").addEventListener("click", () => (playing ? stop() : play()));
    document.addEventListener("keydown", (event) => {
      if (event.target.tagName === "INPUT" || !["ArrowLeft", "ArrowRight", " "].includes(event.key)) return;
      if (event.target.tagName === "BUTTON" && event.key === " ") return;
      event.preventDefault();
      if (event.key === " ") return playing ? stop() : play();
      stop();
      stepFrame(event.key === "ArrowRight" ? 1 : -1);
    });
  }

  function stepFrame(by) {
    const times = flight.frames.map((frame) => frame.t);
    if (!times.length) return setTime(now + by);
    setTime(times[Math.min(times.length - 1, Math.max(0, nearest(times, now) + by))]);
  }

  function play() {
    if (now >= T1 - 0.1) now = T0;
    let last = performance.now();
    const speed = Math.max(1, (T1 - T0) / 60);
    const turn = (at) => {
      now = Math.min(T1, now + (speed * (at - last)) / 1000);
      last = at;
      setTime(now);
      if (now < T1) playing = requestAnimationFrame(turn); else stop();
    };
    playing = requestAnimationFrame(turn);
    $("play").innerHTML = "&#10073;&#10073;";
  }

  function stop() {
    if (playing) cancelAnimationFrame(playing);
    playing = null;
    $("play").innerHTML = "&#9654;";
  }

  // -- the cursor --------------------------------------------------------------------------------------------------

  const frameTimes = flight.frames.map((frame) => frame.t);
  let shown = -2;

  function setTime(t) {
    now = Math.min(T1, Math.max(T0, t));
    $("slider").value = now;
    $("clock").textContent = clock(now);
    $("playhead").style.left = share(now);
    showNow();
    showFrame();
    moveArrow();
    moveCursors();
    moveInSpace();
  }

  function valueAt(name) {
    const curve = flight.curves[name];
    if (!curve) return null;
    const k = nearest(curve.t, now);
    return k < 0 || Math.abs(curve.t[k] - now) > 2 ? null : curve.y[k];
  }

  function showNow() {
    const task = report.tasks.findLast((one) => one.start_s <= now && (one.end_s === null || now <= one.end_s));
    const stage = STAGES.findLast((one) => one.start_s <= now && now <= one.end_s && !(task && task.start_s > one.start_s));
    const k = Math.max(0, indexAt(flight.track.t, now));
    const facts = [
      ["task", stage ? stage.name : task ? words(task.task) : "–"],
      ["mode", flight.track.mode[k] ?? "–"],
      ["height", fixed(valueAt("height"), 1, " m")],
      ["speed", fixed(valueAt("speed"), 1, " m/s")],
      ["off the line", fixed(valueAt("off_line"), 2, " m")],
      ["from the setpoint", fixed(valueAt("from_setpoint"), 2, " m")],
      ["tilt", fixed(valueAt("tilt_deg"), 0, "°")],
      ["battery", fixed(valueAt("battery"), 0, " %")],
    ];
    $("now").replaceChildren(...facts.filter(([, value]) => value !== "–").map(([what, value]) => make("span", {}, what + " ", make("b", {}, value))));
  }

  function showFrame() {
    const k = nearest(frameTimes, now);
    const isNear = k >= 0 && Math.abs(frameTimes[k] - now) < 5;
    $("noframe").hidden = isNear;
    if (!isNear) {
      $("noframe").textContent = frameTimes.length ? "No frame was kept near this time." : "The log holds no frames.";
      $("frame").removeAttribute("src");
      $("lines").replaceChildren();
      $("caption").textContent = "";
      shown = -2;
      return;
    }
    if (k === shown) return;
    shown = k;
    const frame = flight.frames[k];
    const image = $("frame");
    image.onload = () => $("lines").setAttribute("viewBox", `0 0 ${image.naturalWidth} ${image.naturalHeight}`);
    image.src = "data:image/jpeg;base64," + frame.jpeg;
    const line = ([x1, y1, x2, y2], name) => {
      const element = document.createElementNS("http://www.w3.org/2000/svg", "line");
      for (const [key, value] of Object.entries({ x1, y1, x2, y2, class: name })) element.setAttribute(key, value);
      return element;
    };
    $("lines").replaceChildren(...frame.lines.map((ends) => line(ends, "under")), ...frame.lines.map((ends) => line(ends, "over")));
    const seen = frame.angle_deg === null ? "no line" : `${frame.n_lines} conductor${frame.n_lines === 1 ? "" : "s"} at ${frame.angle_deg.toFixed(1)}°, ${frame.offset_px.toFixed(0)} px aside`;
    $("caption").textContent = `Frame ${k + 1} of ${frameTimes.length} at ${clock(frame.t)}: ${frame.trouble ? words(frame.trouble) : seen} (vision ${words(frame.track)}), ${frame.latency_ms.toFixed(0)} ms from capture to estimate`;
  }

  // -- plots -------------------------------------------------------------------------------------------------------

  const CONFIG = { displaylogo: false, responsive: true, displayModeBar: false, scrollZoom: false };
  const axis = (more = {}) => ({ gridcolor: color("grid"), zerolinecolor: color("grid"), linecolor: color("edge"), automargin: true, ...more });
  const layout = (more) => ({
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: color("ink"), size: 12, family: "system-ui, sans-serif" },
    margin: { l: 46, r: 12, t: 8, b: 30 }, showlegend: false, hoverlabel: { bgcolor: color("card"), font: { color: color("ink") } }, ...more,
  });
  /** The track as one curve for each kind of task, with gaps: a trace costs more than its points. */
  const pieces = () => {
    const found = new Map();
    for (const task of report.tasks) {
      const first = Math.max(0, indexAt(flight.track.t, task.start_s));
      const last = task.end_s === null ? flight.track.t.length : indexAt(flight.track.t, task.end_s) + 2;
      if (!found.has(task.task)) found.set(task.task, { task, east: [], north: [], up: [], t: [] });
      const piece = found.get(task.task);
      for (const name of ["east", "north", "up", "t"]) piece[name].push(...flight.track[name].slice(first, last), null);
    }
    return found.values();
  };
  /** The track outside the tasks. */
  const outside = () => STAGES.filter((stage) => stage.start_s >= 0).map((stage) => {
    const first = Math.max(0, indexAt(flight.track.t, stage.start_s)), last = indexAt(flight.track.t, stage.end_s) + 2;
    const cut = (name) => flight.track[name].slice(first, last);
    return { stage, east: cut("east"), north: cut("north"), up: cut("up"), t: cut("t") };
  });
  const troubled = () => report.excursions.map((trouble) => {
    const first = Math.max(0, indexAt(flight.track.t, trouble.start_s)), last = indexAt(flight.track.t, trouble.end_s) + 2;
    const cut = (name) => flight.track[name].slice(first, last);
    return { trouble, east: cut("east"), north: cut("north"), up: cut("up") };
  });

  function bounds() {
    const east = flight.track.east.filter((v) => v !== null), north = flight.track.north.filter((v) => v !== null);
    const most = (list, pick) => list.reduce((a, b) => pick(a, b), list[0] ?? 0);
    let [w, e, s, n] = [most(east, Math.min), most(east, Math.max), most(north, Math.min), most(north, Math.max)];
    const pad = Math.max(8, 0.12 * Math.max(e - w, n - s));
    return { w: w - pad, e: e + pad, s: s - pad, n: n + pad };
  }

  function near(points, box) {
    const reach = 0.4 * Math.max(box.e - box.w, box.n - box.s);
    return points.filter(([n, e]) => e > box.w - reach && e < box.e + reach && n > box.s - reach && n < box.n + reach);
  }

  function drawMap() {
    const box = bounds();
    const traces = [];
    const push = (trace) => traces.push({ type: "scatter", mode: "lines", hoverinfo: "skip", ...trace });
    const frames = () => {
      const places = frameTimes.map((t) => nearest(flight.track.t, t)).filter((k) => k >= 0);
      return { t: frameTimes, east: places.map((k) => flight.track.east[k]), north: places.map((k) => flight.track.north[k]) };
    };
    if (flight.line) {
      for (const conductor of flight.line.conductors) push({ name: "conductor", x: conductor.map((p) => p[1]), y: conductor.map((p) => p[0]), line: { color: color("wire"), width: 1.2 } });
      const poles = near(flight.line.supports, box);
      push({ name: "supports", mode: "markers", x: poles.map((p) => p[1]), y: poles.map((p) => p[0]), marker: { color: color("ink"), size: 9, symbol: "square", line: { color: color("card"), width: 1.5 } } });
    }
    if (flight.fixes.t.length) push({ name: "line as known", mode: "markers", x: flight.fixes.east, y: flight.fixes.north, marker: { color: color("known"), size: 4, opacity: 0.7 } });
    push({ name: "setpoint", x: flight.track.setpoint_east, y: flight.track.setpoint_north, line: { color: color("ink"), width: 1.5, dash: "dot" } });
    if (flight.truth) push({ name: "true way", x: flight.truth.east, y: flight.truth.north, line: { color: color("truth"), width: 1.2 } });
    if (flight.imported) push({ name: "the autopilot's own log", x: flight.imported.east, y: flight.imported.north, line: { color: color("executive"), width: 1.2, dash: "dash" } });
    for (const piece of pieces()) push({ name: words(piece.task.task), x: piece.east, y: piece.north, text: piece.t.map((t) => (t === null ? "" : clock(t))), hoverinfo: "text+name", customdata: piece.t, line: { color: TASKS[piece.task.task] ?? color("ink"), width: 4 } });
    for (const { stage, east, north, t } of outside()) push({ name: stage.name, x: east, y: north, text: t.map(clock), hoverinfo: "text+name", customdata: t, line: { color: color("outside"), width: 4 } });
    for (const { trouble, east, north } of troubled()) push({ name: `trouble: ${words(trouble.kind)}`, x: east, y: north, line: { color: color("bad"), width: 6 }, opacity: 0.6 });
    if (frameTimes.length) {
      const taken = frames();
      push({ name: "frames", mode: "markers", visible: false, x: taken.east, y: taken.north, text: taken.t.map((t) => `frame at ${clock(t)}`), hoverinfo: "text", customdata: taken.t, marker: { color: color("card"), size: 5, line: { color: color("ink"), width: 1 } } });
    }
    const ends = endPlaces();
    for (const [name, place, symbol] of ends) push({ name, mode: "markers", x: [place.east], y: [place.north], text: [`${name}, ${clock(place.t)}`], hoverinfo: "text", customdata: [place.t], marker: { color: color("card"), size: 13, symbol, line: { color: color("ink"), width: 3 } } });
    mapLegend(traces);
    const images = flight.ground ? [{ source: flight.ground.image, xref: "x", yref: "y", x: flight.ground.west_m, y: flight.ground.north_m, sizex: flight.ground.width_m, sizey: flight.ground.height_m, sizing: "stretch", layer: "below", opacity: 0.75 }] : [];
    const drawn = Plotly.newPlot("map", traces, layout({
      xaxis: axis({ title: { text: "east [m]" }, range: [box.w, box.e], zeroline: false, showgrid: !flight.ground }),
      yaxis: axis({ title: { text: "north [m]" }, range: [box.s, box.n], scaleanchor: "x", zeroline: false, showgrid: !flight.ground }),
      hovermode: "closest", dragmode: "pan", images,
    }), { ...CONFIG, scrollZoom: true });
    $("map").on("plotly_click", (event) => { const t = event.points[0]?.customdata; if (t !== undefined && t !== null) setTime(t); });
    $("map").on("plotly_relayout", moveArrow);
    $("map").on("plotly_afterplot", moveArrow);
    return drawn;
  }

  /** Where the way flown begins and ends. */
  function endPlaces() {
    const track = flight.track, first = Math.max(0, indexAt(track.t, 0)), last = track.t.length - 1;
    if (last < 0) return [];
    const at = (k) => ({ t: track.t[k], east: track.east[k], north: track.north[k] });
    const end = report.is_truncated || report.result === "unfinished" ? "where the log ends" : report.landing?.is_disarmed ? (report.result === "completed" ? "landing" : "end of the flight") : "end of the flight";
    const start = flight.times_since === "take-off" ? "take-off" : "start";
    return [[start, at(first), "circle"], [end, at(last), "square"]];
  }

  const LEGEND = [
    ["conductors of the line, true", (name) => name === "conductor", "wire", "height:2px"],
    ["supports", (name) => name === "supports", "ink", "width:9px;height:9px"],
    ["the line as known in flight", (name) => name === "line as known", "known", "width:6px;height:6px;border-radius:50%"],
    ["setpoints", (name) => name === "setpoint", "ink", "", "dash"],
    ["track, true", (name) => name === "true way", "truth", "height:2px"],
    ["track by the autopilot's own log", (name) => name === "the autopilot's own log", "executive", "height:2px"],
    ["went wrong", (name) => name.startsWith("trouble: "), "bad", "height:6px;opacity:.6"],
    ["camera frames", (name) => name === "frames", "card", "width:7px;height:7px;border-radius:50%;border:1px solid"],
  ];

  /** What each mark of the map is; a click hides or shows it. */
  function mapLegend(traces) {
    const entry = (what, isOf, css, kind = "") => {
      const members = traces.flatMap((trace, k) => (isOf(trace.name) ? [k] : []));
      if (!members.length) return null;
      const mark = make("i", { class: kind });
      mark.style.cssText = css;
      const button = make("button", { type: "button", title: "Hide or show it", "aria-pressed": String(traces[members[0]].visible !== false) }, mark, what);
      button.addEventListener("click", () => {
        const isShown = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(isShown));
        Plotly.restyle("map", { visible: isShown }, members);
      });
      return button;
    };
    const tasks = [...new Set(report.tasks.map((task) => task.task))];
    const stages = [...new Set(STAGES.map((stage) => stage.name))];
    const entries = [
      ...LEGEND.map(([what, isOf, paint, css, kind]) => entry(what, isOf, `${css};background:${color(paint)};color:${color(paint === "card" ? "ink" : paint)}`, kind)),
      ...endPlaces().map(([name, , symbol]) => entry(name, (other) => other === name, "", symbol === "circle" ? "place" : "place end")),
      make("span", {}, tasks.length ? "track flown:" : ""),
      ...tasks.map((task) => entry(words(task), (name) => name === words(task), `background:${TASKS[task] ?? color("ink")}`)),
      ...stages.map((stage) => entry(stage, (name) => name === stage, `background:${color("outside")}`)),
    ];
    $("maplegend").replaceChildren(...entries.filter((one) => one !== null && one.textContent));
  }

  function moveArrow() {
    const arrow = $("arrow"), drawn = $("map")._fullLayout;
    if (!drawn || $("map").hidden || !flight.track.t.length) { arrow.style.display = "none"; return; }
    const k = Math.max(0, indexAt(flight.track.t, now));
    const x = drawn.xaxis.l2p(flight.track.east[k]) + drawn.xaxis._offset, y = drawn.yaxis.l2p(flight.track.north[k]) + drawn.yaxis._offset;
    arrow.style.display = "block";
    arrow.style.transform = `translate(${x}px, ${y}px) rotate(${flight.track.yaw_deg[k]}deg)`;
  }

  let cursorTrace = -1;

  function drawSpace() {
    const box = bounds();
    const traces = [];
    const push = (trace) => traces.push({ type: "scatter3d", mode: "lines", hoverinfo: "skip", ...trace });
    if (flight.line) {
      const ground = Math.min(0, ...flight.track.up.filter((v) => v !== null));
      for (const conductor of flight.line.conductors) {
        const points = near(conductor, box);
        push({ name: "conductor", x: points.map((p) => p[1]), y: points.map((p) => p[0]), z: points.map((p) => -p[2]), line: { color: color("line"), width: 2 } });
      }
      for (const [n, e, d] of near(flight.line.supports, box)) push({ name: "support", x: [e, e], y: [n, n], z: [-d, -d > ground + 3 ? ground : -d - 10], line: { color: color("dim"), width: 7 } });
    }
    push({ name: "setpoint", x: flight.track.setpoint_east, y: flight.track.setpoint_north, z: flight.track.setpoint_up, line: { color: color("setpoint"), width: 2 } });
    if (flight.truth) push({ name: "true way", x: flight.truth.east, y: flight.truth.north, z: flight.truth.up, line: { color: color("truth"), width: 3 } });
    for (const piece of pieces()) push({ name: words(piece.task.task), x: piece.east, y: piece.north, z: piece.up, line: { color: TASKS[piece.task.task] ?? color("ink"), width: 6 } });
    for (const { stage, east, north, up } of outside()) push({ name: stage.name, x: east, y: north, z: up, line: { color: color("outside"), width: 6 } });
    cursorTrace = traces.length;
    push({ name: "vehicle", mode: "markers", x: [0], y: [0], z: [0], marker: { color: color("accent"), size: 7, line: { color: color("card"), width: 1 } } });
    const side = (text) => ({ title: { text }, gridcolor: color("grid"), zerolinecolor: color("grid"), color: color("dim"), backgroundcolor: "rgba(0,0,0,0)" });
    Plotly.newPlot("space", traces, layout({
      margin: { l: 0, r: 0, t: 0, b: 0 },
      scene: { aspectmode: "data", xaxis: side("east [m]"), yaxis: side("north [m]"), zaxis: side("up [m]"), camera: { eye: { x: 0.75, y: -0.95, z: 0.55 } } },
    }), CONFIG);
    moveInSpace();
  }

  let waiting = false;
  function moveInSpace() {
    if (cursorTrace < 0 || $("space").hidden || waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      const k = Math.max(0, indexAt(flight.track.t, now));
      Plotly.restyle("space", { x: [[flight.track.east[k]]], y: [[flight.track.north[k]]], z: [[flight.track.up[k]]] }, [cursorTrace]);
    });
  }

  function tabs() {
    for (const button of document.querySelectorAll(".tabs button")) {
      button.addEventListener("click", () => {
        for (const other of document.querySelectorAll(".tabs button")) other.setAttribute("aria-selected", String(other === button));
        $("map").hidden = button.dataset.view !== "map";
        $("maplegend").hidden = $("map").hidden;
        $("space").hidden = button.dataset.view !== "space";
        if (button.dataset.view === "space" && cursorTrace < 0 && window.Plotly) drawSpace();
        moveArrow();
        moveInSpace();
      });
    }
  }

  const CHARTS = [
    ["From the line, and why", "m", [["off_line", "off the line", "ink", 2], ["perception", "the line elsewhere than told", "perception", 1.2], ["executive", "setpoint off the line as told", "executive", 1.2], ["tracking", "vehicle off its setpoint", "autopilot", 1.2]]],
    ["Height", "m", [["height_setpoint", "setpoint", "setpoint", 2], ["height", "vehicle", "ink", 1.6], ["imported_height", "the autopilot's own log", "executive", 1.2], ["height_over_line", "over the conductors, true", "truth", 1.4], ["height_over_line_known", "over the conductors, as known", "line", 1.2]]],
    ["The line in the image: angle", "°", [["angle_deg", "angle", "perception", 1.2]]],
    ["The line in the image: offset", "px", [["offset_px", "offset", "perception", 1.2]]],
    ["Setpoint against achieved", "m", [["from_setpoint", "vehicle from its setpoint", "autopilot", 1.4]]],
    ["Speed over ground", "m/s", [["speed", "speed", "ink", 1.6]]],
    ["Tilt", "°", [["tilt_deg", "tilt", "wind", 1.4]]],
    ["Push of the air", "m/s²", [["push", "what the air took from the thrust", "executive", 1.2]]],
    ["Delays", "ms", [["latency_ms", "frame to estimate", "perception", 1], ["telemetry_age_ms", "telemetry's age", "executive", 1], ["tick_late_ms", "control tick late", "bad", 1], ["round_trip_ms", "link there and back", "wind", 1.2]]],
    ["Battery", "%", [["battery", "battery", "good", 1.6]]],
    ["Battery, by the autopilot's own log", "V, A", [["imported_voltage", "voltage", "good", 1.4], ["imported_current", "current", "wind", 1.2]]],
    ["Motors, by the autopilot's own log", "share", [1, 2, 3, 4, 5, 6, 7, 8].map((k) => [`motor_${k}`, `motor ${k}`, ["ink", "perception", "executive", "autopilot", "wind", "line", "good", "bad"][k - 1], 1])],
  ];
  const charts = [];
  let isSyncing = false;

  function drawCharts() {
    for (const name of ["tick_late_ms", "telemetry_age_ms"]) if (flight.curves[name]?.y.every((v) => !v)) delete flight.curves[name]; // virtual time is never late
    const seen = new IntersectionObserver((entries) => {
      for (const entry of entries) if (entry.isIntersecting) { seen.unobserve(entry.target); entry.target.draw(); }
    }, { rootMargin: "300px" });
    for (const [title, unit, curves] of CHARTS) {
      const present = curves.filter(([name]) => flight.curves[name]);
      if (!present.length) continue;
      const plot = make("div", { class: "plot" }), line = make("div", { class: "cursor" });
      const keys = present.length === 1 ? [] : present.map(([, what, paint]) => {
        const swatch = make("i");
        swatch.style.background = color(paint);
        return make("span", { class: "key" }, swatch, what);
      });
      const card = make("div", { class: "card chart" }, make("h2", {}, `${title} [${unit}] `, ...keys), plot, line);
      card.draw = () => {
        Plotly.newPlot(plot, present.map(([name, what, paint, width]) => ({
          name: what, type: "scatter", mode: "lines", x: flight.curves[name].t, y: flight.curves[name].y, connectgaps: false,
          line: { color: color(paint), width }, hovertemplate: "%{y}<extra>" + what + "</extra>",
        })), layout({
          xaxis: axis({ range: range ?? [T0, T1], ticksuffix: " s" }), yaxis: axis({}), hovermode: "x", hoverdistance: -1, dragmode: "zoom",
          shapes: report.excursions.map((trouble) => ({ type: "rect", xref: "x", yref: "paper", x0: trouble.start_s, x1: trouble.end_s, y0: 0, y1: 1, fillcolor: color(trouble.culprit), opacity: 0.12, line: { width: 0 } })),
        }), CONFIG);
        plot.on("plotly_click", (event) => setTime(event.points[0].x));
        plot.on("plotly_relayout", (change) => follow(plot, change));
        charts.push({ plot, line });
        moveCursors();
      };
      $("charts").append(card);
      seen.observe(card);
    }
    const short = (value) => (value >= 10 ? value.toFixed(0) : value.toFixed(1));
    for (const [title, bins] of Object.entries(flight.histograms)) {
      const plot = make("div", { class: "plot" });
      const card = make("div", { class: "card" }, make("h2", {}, title[0].toUpperCase() + title.slice(1), make("span", { class: "dim" }, ` median ${short(bins.p50)}, p95 ${short(bins.p95)}, at most ${short(bins.max)} ms`)), plot);
      card.draw = () => Plotly.newPlot(plot, [{
        type: "bar", x: bins.counts.map((_, k) => (bins.edges_ms[k] + bins.edges_ms[k + 1]) / 2), y: bins.counts, marker: { color: color("executive") },
        hovertemplate: "%{y} times at %{x:.1f} ms<extra></extra>",
      }], layout({ bargap: 0.05, xaxis: axis({ ticksuffix: " ms" }), yaxis: axis({ type: "log", dtick: 1 }), margin: { l: 40, r: 8, t: 4, b: 26 } }), CONFIG);
      $("histograms").append(card);
      seen.observe(card);
    }
  }

  let range = null;
  function follow(source, change) {
    if (isSyncing) return;
    if (change["xaxis.autorange"]) range = [T0, T1];
    else if (change["xaxis.range[0]"] !== undefined) range = [change["xaxis.range[0]"], change["xaxis.range[1]"]];
    else return;
    isSyncing = true;
    Promise.all(charts.map(({ plot }) => (plot === source && !change["xaxis.autorange"] ? null : Plotly.relayout(plot, { "xaxis.range": range.slice() })))).then(() => { isSyncing = false; moveCursors(); });
  }

  function moveCursors() {
    for (const { plot, line } of charts) {
      const drawn = plot._fullLayout;
      if (!drawn) continue;
      const x = drawn.xaxis.l2p(now), isInside = x >= 0 && x <= drawn.xaxis._length;
      line.style.display = isInside ? "block" : "none";
      line.style.left = `${plot.offsetLeft + drawn.xaxis._offset + x}px`;
      line.style.top = `${plot.offsetTop + drawn.yaxis._offset}px`;
      line.style.height = `${drawn.yaxis._length}px`;
    }
  }

  // -- tables ------------------------------------------------------------------------------------------------------

  /** Cells of their own kind: numbers stand at the right, times and names do not break. */
  const number = (text) => ({ text, kind: "num" });
  const time = (t) => ({ text: clock(t), kind: "time" });
  const name = (text) => ({ text, kind: "name" });

  function table(id, title, head, rows) {
    if (!rows.length) return;
    const cell = (tag, value) => (value instanceof Node ? make(tag, { class: "name" }, value) : make(tag, { class: value?.kind ?? "" }, value?.text ?? value ?? ""));
    if (title) $(id).append(make("h2", {}, title));
    $(id).append(make("table", {}, head.length ? make("tr", {}, ...head.map((h, k) => make("th", { class: rows[0].cells[k]?.kind ?? "" }, h))) : null, ...rows.map(({ cells, t, tone }) => {
      const row = make("tr", { ...(t === undefined ? {} : { "data-t": t, onclick: () => setTime(t) }), class: tone ?? "" });
      row.append(...cells.map((value) => cell("td", value)));
      return row;
    })));
  }

  function tables() {
    if (report.legs.length || report.lateral) {
      const line = (text) => make("p", { class: "dim" }, text);
      $("legs").append(make("h2", {}, "How well the line was followed"));
      if (report.lateral) {
        $("legs").append(make("h3", {}, "From the true line"), line("How far the vehicle was sideways from where the line really is, which only a simulated flight knows."));
        table("legs", null, ["", "mean", "p95", "at most"], [{ cells: ["while following", ...["mean_m", "p95_m", "max_m"].map((name) => number(fixed(report.lateral[name], 2, " m")))] }]);
      }
      if (report.legs.length) {
        $("legs").append(make("h3", {}, "Straightness"), line("How far the positions of a leg are from the straight line that fits them best, wherever the power line is (Cerón, equations 6.3 to 6.5, table 6.2): how steadily it flew, not how near."));
        table("legs", null, ["", "mean", "p95", "positions"], report.legs.map((leg, k) => ({ cells: [`leg ${k + 1}`, number(fixed(leg.avg_error_m, 3, " m")), number(fixed(leg.p95_error_m, 3, " m")), number(String(leg.n_points))] })));
      }
    }
    table("tasktable", "Tasks", ["task", "from", "took", "result"], report.tasks.map((task) => ({
      cells: [name(words(task.task)), time(task.start_s), number(task.end_s === null ? "" : `${(task.end_s - task.start_s).toFixed(1)} s`), `${words(task.result)}: ${task.reason}`], t: task.start_s, tone: { failed: "error", timed_out: "error" }[task.result],
    })));
    table("events", "Events", ["at", "event", "what happened"], report.events.map((event) => ({
      cells: [time(event.t_s), make("span", { class: event.severity }, words(event.name)), event.message + (event.reaction === "continue" ? "" : ` → ${words(event.reaction)}`)], t: event.t_s,
    })));
    table("preflight", `Pre-flight: ${counted(report.preflight.n_checks, "check")}`, [], [
      ...report.preflight.failures.map((line) => ({ cells: [make("span", { class: "failed" }, "failed"), line] })),
      ...report.preflight.warnings.map((line) => ({ cells: [make("span", { class: "warning" }, "warning"), line] })),
      ...(report.preflight.failures.length + report.preflight.warnings.length || !report.preflight.n_checks ? [] : [{ cells: [make("span", { class: "ok" }, "all passed")] }]),
    ]);
    table("texts", "The autopilot's own words", [], flight.texts.map(([t, text]) => ({ cells: [time(t), text], t })));
    table("facts", "Flown with", [], Object.entries(flight.facts).map(([key, value]) => ({ cells: [{ text: key, kind: "dim fact" }, value] })));
  }

  heading();
  blame();
  timeline();
  tables();
  tabs();
  // What people ask for first: where it went wrong, else where the line is reached.
  const failed = report.tasks.find((task) => task.result !== "completed" && task.end_s !== null);
  setTime(report.excursions[0]?.start_s ?? failed?.end_s ?? report.tasks.find((task) => task.task === "follow_lines")?.start_s ?? 0);
  performance.mark("usable");
  // The plots' library takes a second to be read: what needs no plot is there before it.
  addEventListener("DOMContentLoaded", () => requestAnimationFrame(() => setTimeout(() => {
    document.head.append(make("script", {}, $("plotly").textContent));
    const map = drawMap();
    drawCharts();
    if (!$("space").hidden) drawSpace();
    map.then(() => requestAnimationFrame(() => {
      performance.mark("drawn");
      document.body.dataset.ready = "yes";
    }));
  })));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => location.reload());
  window.lineflight = { setTime, get now() { return now; }, get frame() { return shown; } };
})();
