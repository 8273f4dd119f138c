// Timelines of streams: what is shown and believed, the probability of the true class, and the way of each camera.

const lines = parsed("lines");
const DASHES = { solid: [], dashdot: [8, 3, 2, 3], longdash: [9, 4], longdashdot: [12, 3, 2, 3], dot: [2, 3], dash: [5, 4] };
const TINTS = ["@0/0.5", "@5/0.55", "@2/0.5", "@3/0.6", "@4/0.5", "@1/0.5", "@0/0.22", "@5/0.25", "@2/0.22", "@3/0.3", "@4/0.22", "@1/0.22"];
const NOWHERE = 65535; // a direction that is not known
const BAND = 24;
const PLOT = 62;
const GAP = 14;

const tintOf = (label) => (label === lines.classes.length - 1 ? "@neutral/0.16" : TINTS[label % TINTS.length]);

function decodedLine(line) {
  if (line.decoded === undefined) {
    const cast = Object.entries(line.planners).map(([name, of]) => [
      name,
      { believed: of.believed, sure: decoded(of.sure, "uint8"), path: viewpointsOf(of.path) },
    ]);
    line.decoded = { facing: line.facing === null ? null : decoded(line.facing, "uint16"), cast: Object.fromEntries(cast) };
  }
  return line.decoded;
}

// The class in a frame, from pairs of a frame and the class from there on.
function classAt(rows, frame) {
  let found = rows[1];
  for (let at = 0; at < rows.length && rows[at] <= frame; at += 2) found = rows[at + 1];
  return found;
}

// Where people are seen from at a point, in degrees from -180 to 180: 0 is from their front, if that is known.
function bearing(line, path, at) {
  const { facing } = decodedLine(line);
  const degrees = (path[3 * at + 1] * 180) / Math.PI;
  if (facing === null) return degrees;
  if (facing[at] === NOWHERE) return NaN;
  return ((degrees - facing[at] / 100 + 540) % 360) - 180;
}

// The plots below the bands: a title, ticks, and a value for each point of a camera's way.
function plotsOf(line) {
  const told = line.facing !== null;
  const [near, far] = lines.distances;
  return [
    { title: "true class", ticks: [[0, "0 %"], [100, "100 %"]], value: (of, at) => of.sure[at] },
    { title: "distance", ticks: [[near, `${near} m`], [far, `${far} m`]], value: (of, at) => of.path[3 * at] },
    told
      ? { title: "seen from", ticks: [[-180, ""], [-90, ""], [0, "front"], [90, ""], [180, "behind"]], turns: true, value: (of, at) => bearing(line, of.path, at) }
      : { title: "azimuth", ticks: [[0, "0°"], [180, "180°"], [360, "360°"]], turns: true, value: (of, at) => bearing(line, of.path, at) },
    { title: "polar angle", ticks: [[lines.lowest, lines.lowest === 90 ? "level" : `${lines.lowest}°`], [0, "above"]], value: (of, at) => (of.path[3 * at + 2] * 180) / Math.PI },
  ];
}

const fitting = (pen, text, width) => {
  if (pen.measureText(text).width <= width) return text;
  for (let kept = text.length - 1; kept > 2; kept -= 1) {
    if (pen.measureText(`${text.slice(0, kept)}…`).width <= width) return `${text.slice(0, kept)}…`;
  }
  return "";
};

// Where time is on the canvas.
function spanOf(width) {
  const left = width < 560 ? 74 : 118;
  return { left, width: width - left - 8 };
}

// Draw a timeline; `frame` is where the reader is, or null.
function drawTimeline(canvas, line, cast, frame) {
  const plots = plotsOf(line);
  const high = 2 + (cast.length + 1) * (BAND + 8) + GAP + plots.length * (PLOT + GAP) + 26;
  const { pen, width } = prepared(canvas, high / (canvas.clientWidth || 300));
  const span = spanOf(width);
  const x = (at) => span.left + (span.width * at) / lines.frames;
  let top = 2;
  const label = (text, tint, weight = "") => {
    pen.font = `${weight} 12px system-ui, sans-serif`;
    pen.fillStyle = colour(tint);
    pen.textAlign = "right";
    pen.fillText(fitting(pen, text, span.left - 10), span.left - 8, top + BAND / 2 + 4);
    pen.textAlign = "left";
    pen.font = "12px system-ui, sans-serif";
  };
  label("shown", "@text", "bold");
  drawBand(pen, x, top, line.shown);
  const below = top + BAND;
  top += BAND + 8;
  for (const { name, look } of cast) {
    label(name, look.colour === "@neutral" ? "@text" : look.colour, "bold");
    drawBand(pen, x, top, line.planners[name].believed);
    drawWrong(pen, x, top + BAND, line.shown, line.planners[name].believed);
    top += BAND + 8;
  }
  top += GAP - 4;
  const bottom = top + plots.length * (PLOT + GAP) - GAP;
  for (let at = 2; at < line.shown.length; at += 2) {
    stroke(pen, [[x(line.shown[at]), below], [x(line.shown[at]), bottom]], colour("@neutral/0.35"), 1);
  }
  for (const plot of plots) {
    drawPlot(pen, span, x, top, plot, line, cast);
    top += PLOT + GAP;
  }
  drawSeconds(pen, span, x, bottom);
  if (frame !== null) stroke(pen, [[x(frame + 0.5), 0], [x(frame + 0.5), bottom]], colour("@text"), 1.5);
}

function drawBand(pen, x, top, rows) {
  for (let at = 0; at < rows.length; at += 2) {
    const [from, to] = [x(rows[at]), x(at + 2 < rows.length ? rows[at + 2] : lines.frames)];
    pen.fillStyle = colour(tintOf(rows[at + 1]));
    pen.fillRect(from, top, to - from, BAND);
    if (rows[at + 1] === lines.classes.length - 1) continue;
    pen.fillStyle = colour("@text");
    const name = fitting(pen, lines.classes[rows[at + 1]], to - from - 8);
    if (name !== "") pen.fillText(name, from + 4, top + BAND / 2 + 4);
  }
}

// A dark bar where the answer is not what is shown.
function drawWrong(pen, x, top, shown, believed) {
  const cuts = [...new Set([...shown, ...believed].filter((_, at) => at % 2 === 0)), lines.frames].sort((a, b) => a - b);
  pen.fillStyle = colour("@text");
  for (let at = 0; at + 1 < cuts.length; at += 1) {
    if (classAt(shown, cuts[at]) === classAt(believed, cuts[at])) continue;
    pen.fillRect(x(cuts[at]), top + 1, x(cuts[at + 1]) - x(cuts[at]), 4);
  }
}

function drawPlot(pen, span, x, top, plot, line, cast) {
  const ends = plot.ticks.map(([value]) => value);
  const upside = plot.ticks[0][0] > plot.ticks.at(-1)[0]; // the last tick is on top
  const [low, high] = upside ? [ends[0], ends.at(-1)] : [Math.min(...ends), Math.max(...ends)];
  const y = (value) => top + 4 + ((PLOT - 8) * (high - value)) / (high - low);
  pen.textAlign = "right";
  for (const [value, text] of plot.ticks) {
    stroke(pen, [[span.left, y(value)], [span.left + span.width, y(value)]], colour("@grid"), 1);
    pen.fillStyle = colour("@soft");
    pen.fillText(text, span.left - 8, y(value) + 4);
  }
  if (span.left > 100) {
    pen.textAlign = "left";
    pen.fillStyle = colour("@text");
    pen.fillText(plot.title, 2, y((low + high) / 2) + 4);
  }
  pen.textAlign = "left";
  for (const { name, look } of cast) {
    const of = decodedLine(line).cast[name];
    let part = [];
    let before = NaN;
    const flush = () => {
      if (part.length > 1) stroke(pen, part, colour(look.colour), 1.8, look.dash);
      part = [];
    };
    for (let at = 0; at < of.sure.length; at += 1) {
      const value = plot.value(of, at);
      if (Number.isNaN(value) || (plot.turns && Math.abs(value - before) > 180)) flush();
      if (!Number.isNaN(value)) part.push([x(at * lines.every), y(value)]);
      before = value;
    }
    flush();
  }
}

function drawSeconds(pen, span, x, bottom) {
  const seconds = lines.frames / lines.fps;
  const step = [1, 2, 5, 10, 30, 60, 120, 300, 600].find((each) => (seconds / each) * 46 < span.width) ?? 1800;
  pen.fillStyle = colour("@soft");
  for (let second = 0; second <= seconds + 1e-9; second += step) {
    const at = x(second * lines.fps);
    stroke(pen, [[at, bottom], [at, bottom + 4]], colour("@neutral"), 1);
    pen.textAlign = second + step > seconds + 1e-9 ? "right" : "center";
    pen.fillText(second === 0 ? "0 s" : `${second}`, at, bottom + 17);
  }
  pen.textAlign = "left";
}

// What is at a frame, in words.
function momentText(line, cast, frame) {
  const truth = classAt(line.shown, frame);
  const at = Math.min(Math.round(frame / lines.every), decodedLine(line).cast[cast[0].name].sure.length - 1);
  const degrees = (angle) => `${Math.round(angle)}°`;
  const each = cast.map(({ name }) => {
    const of = decodedLine(line).cast[name];
    const said = classAt(line.planners[name].believed, frame);
    const turn = bearing(line, of.path, at);
    const way = Number.isNaN(turn) ? "" : line.facing === null ? `, azimuth ${degrees(turn)}` : `, ${degrees(Math.abs(turn))} from their front`;
    return `${name} answers ${lines.classes[said]} (${said === truth ? "right" : "wrong"}, ${of.sure[at]} % for what is shown), from ${of.path[3 * at].toFixed(1)} m${way}, polar angle ${degrees((of.path[3 * at + 2] * 180) / Math.PI)}`;
  });
  return `${(frame / lines.fps).toFixed(1)} s: ${lines.classes[truth]}. ${each.join("; ")}.`;
}

function frameAt(canvas, event) {
  const span = spanOf(canvas.clientWidth);
  const share = (event.clientX - canvas.getBoundingClientRect().left - span.left) / span.width;
  return Math.round(Math.min(1, Math.max(0, share)) * (lines.frames - 1));
}

const lineOf = (episode) => lines.episodes.find((line) => line.episode === episode);

// The section of timelines: the planner in focus, and no-act.
function startTimelines() {
  const canvas = byId("timeline");
  const focus = document.querySelector('select[data-group="focus"]');
  const reader = { frame: null };
  for (const option of [...byId("watched").options]) if (lineOf(Number(option.value)) === undefined) option.remove();
  const redraw = () => {
    const names = [...new Set([focus.value, "no-act"])].filter((name) => lines.looks[name] !== undefined);
    const cast = names.map((name) => ({ name, look: { colour: lines.looks[name].colour, dash: DASHES[lines.looks[name].dash] } }));
    const line = lineOf(Number(byId("watched").value));
    drawTimeline(canvas, line, cast, reader.frame);
    byId("moment").textContent = reader.frame === null ? "" : momentText(line, cast, reader.frame);
  };
  const move = (frame) => {
    reader.frame = Math.min(lines.frames - 1, Math.max(0, frame));
    redraw();
  };
  canvas.addEventListener("pointermove", (event) => move(frameAt(canvas, event)));
  canvas.addEventListener("pointerdown", (event) => move(frameAt(canvas, event)));
  canvas.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 };
    if (!(event.key in steps)) return;
    move((reader.frame ?? 0) + steps[event.key] * lines.every);
    event.preventDefault();
  });
  byId("watched").addEventListener("change", redraw);
  focus.addEventListener("change", redraw);
  dark.addEventListener("change", redraw);
  new ResizeObserver(redraw).observe(canvas.parentElement);
  redraw();
}

if (lines !== null) startTimelines();
