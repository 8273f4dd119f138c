// What one planner's camera sees, what each direction is worth to it, and what is believed.

function drawImage(canvas, of, frame) {
  const [imageWidth, imageHeight] = replays.image;
  const { pen, width } = prepared(canvas, imageHeight / imageWidth);
  const { persons, joints, bones } = replays;
  const box = framed(of);
  const scale = width / box.width;
  const first = frame * persons * joints;
  const at = (joint) => [
    (of.sensed[2 * (first + joint)] - box.left) * scale,
    (of.sensed[2 * (first + joint) + 1] - box.top) * scale,
  ];
  for (let who = 0; who < persons; who += 1) {
    const [tint, dash] = person(who);
    for (const [from, to] of bones) {
      const ends = [who * joints + from, who * joints + to];
      if (ends.some((joint) => of.missed[first + joint])) continue;
      stroke(pen, ends.map(at), colour(tint), 2.5, dash);
    }
    for (let joint = who * joints; joint < (who + 1) * joints; joint += 1) {
      if (!of.missed[first + joint]) dot(pen, at(joint), 2, colour(tint));
    }
  }
  pen.fillStyle = colour("@soft");
  pen.fillText(`${box.zoom.toFixed(1)} x enlarged`, 8, 16);
}

// The part of the image that people fill in this episode, with some room, of the image's own shape.
function framed(of) {
  if (of.box !== undefined) return of.box;
  const [imageWidth, imageHeight] = replays.image;
  const reach = [0, 0];
  of.sensed.forEach((value, at) => {
    if (of.missed[at >> 1]) return;
    const half = at % 2 ? imageHeight / 2 : imageWidth / 2;
    reach[at % 2] = Math.max(reach[at % 2], Math.abs(value - half) / half);
  });
  const share = Math.min(1, 1.1 * Math.max(...reach, 0.05));
  of.box = {
    left: (imageWidth * (1 - share)) / 2,
    top: (imageHeight * (1 - share)) / 2,
    width: imageWidth * share,
    zoom: 1 / share,
  };
  return of.box;
}

function drawMap(canvas, of, look, frame) {
  const { pen, width, height } = prepared(canvas, 0.5);
  const inner = { left: 34, top: 8, width: width - 44, height: height - 34 };
  const at = (viewpoints, step) => [
    inner.left + (inner.width * viewpoints[3 * step + 1]) / (2 * Math.PI),
    inner.top + (inner.height * viewpoints[3 * step + 2] * 180) / (Math.PI * replays.lowest),
  ];
  if (of.field !== null) drawField(pen, inner, of.field, Math.min(frame, replays.frames - 2));
  drawAxes(pen, inner);
  const tint = colour(look.colour);
  const steps = Array.from({ length: frame + 1 }, (_, step) => at(of.path, step));
  const whole = Array.from({ length: replays.frames }, (_, step) => at(of.path, step));
  for (const part of unbroken(whole, inner.width)) stroke(pen, part, colour("@paper"), 5);
  for (const part of unbroken(whole, inner.width)) stroke(pen, part, colour(`${look.colour}/0.4`), 2);
  for (const part of unbroken(steps, inner.width)) stroke(pen, part, tint, 3);
  if (of.target !== null && frame < replays.frames - 1) diamond(pen, at(of.target, frame), 7, tint);
  dot(pen, at(of.path, frame), 6.5, colour("@paper"));
  dot(pen, at(of.path, frame), 4.5, tint);
}

// Pieces of a line on the map: where it leaves at 360 degrees it comes back at 0.
function unbroken(points, width) {
  const parts = [[]];
  points.forEach((point, at) => {
    if (at && Math.abs(point[0] - points[at - 1][0]) > width / 2) parts.push([]);
    parts.at(-1).push(point);
  });
  return parts;
}

function drawField(pen, inner, field, frame) {
  const [around, down] = replays.map;
  const image = new ImageData(around, down);
  const [poor, rich] = [colour("@paper"), colour("@0")].map((hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16)));
  const values = field.values.subarray(frame * around * down, (frame + 1) * around * down);
  const low = Math.min(...values);
  const span = Math.max(1, Math.max(...values) - low);
  values.forEach((value, cell) => {
    const share = (value - low) / span;
    for (let part = 0; part < 3; part += 1) image.data[4 * cell + part] = poor[part] + share * (rich[part] - poor[part]);
    image.data[4 * cell + 3] = 255;
  });
  const small = new OffscreenCanvas(around, down);
  small.getContext("2d").putImageData(image, 0, 0);
  pen.imageSmoothingEnabled = true;
  // From the middle of the first cell to the middle of the last.
  pen.drawImage(small, 0.5, 0.5, around - 1, down - 1, inner.left, inner.top, inner.width, inner.height);
}

function drawAxes(pen, inner) {
  const tint = colour("@neutral");
  pen.fillStyle = colour("@soft");
  pen.textAlign = "center";
  for (const degrees of [0, 90, 180, 270, 360]) {
    const x = inner.left + (inner.width * degrees) / 360;
    stroke(pen, [[x, inner.top + inner.height], [x, inner.top + inner.height + 4]], tint, 1);
    pen.textAlign = degrees === 360 ? "right" : "center";
    pen.fillText(`${degrees}°`, x, inner.top + inner.height + 18);
  }
  pen.textAlign = "right";
  for (const degrees of [0, 45, 90]) {
    const y = inner.top + (inner.height * degrees) / replays.lowest;
    pen.fillText(`${degrees}°`, inner.left - 4, Math.min(y + 4, inner.top + inner.height));
  }
  pen.textAlign = "left";
  pen.strokeStyle = tint;
  pen.lineWidth = 1;
  pen.strokeRect(inner.left, inner.top, inner.width, inner.height);
}

// The probability of the true class over the episode, one line a planner.
function drawCourse(canvas, cast, labels, frame) {
  const { pen, width, height } = prepared(canvas, Math.min(0.5, 110 / (canvas.clientWidth || 300)));
  const classes = replays.classes.length;
  const inner = { left: 34, top: 8, width: width - 44, height: height - 16 };
  const x = (step) => inner.left + (inner.width * step) / Math.max(1, replays.frames - 1);
  const y = (share) => inner.top + inner.height * (1 - share);
  pen.fillStyle = colour("@soft");
  pen.textAlign = "right";
  for (const share of [0, 0.5, 1]) {
    stroke(pen, [[inner.left, y(share)], [inner.left + inner.width, y(share)]], colour("@grid"), 1);
    pen.fillText(`${100 * share}`, inner.left - 5, y(share) + 4);
  }
  pen.textAlign = "left";
  for (const { of, look } of cast) {
    const line = Array.from({ length: replays.frames }, (_, step) => [x(step), y(of.belief[step * classes + labels[step]] / 10000)]);
    stroke(pen, line, colour(look.colour), 2.5, look.dash);
    dot(pen, line[frame], 5, colour(look.colour));
  }
  stroke(pen, [[x(frame), inner.top], [x(frame), inner.top + inner.height]], colour("@text"), 1);
}

const SHOWN = 6; // classes
const SHOWN_OF_STREAM = 9;

// The classes that bars are drawn for: the true one, and those that were most believed at any frame. In a stream others
// are true from time to time, so none of them comes first.
function shownClasses(cast, labels) {
  const classes = replays.classes.length;
  const most = new Array(classes).fill(0);
  for (const { of } of cast) of.belief.forEach((value, at) => (most[at % classes] = Math.max(most[at % classes], value)));
  for (const label of labels) most[label] = Infinity;
  const order = [...most.keys()].sort((a, b) => most[b] - most[a] || a - b);
  if (replays.streams) return order.slice(0, SHOWN_OF_STREAM).sort((a, b) => a - b);
  return order.slice(0, SHOWN).sort((a, b) => (b === labels[0]) - (a === labels[0]) || a - b);
}

function fillBeliefs(list, of, frame, label) {
  const classes = replays.classes.length;
  for (const item of list.children) {
    const isTrue = Number(item.dataset.label) === label;
    const name = item.querySelector(".name");
    name.classList.toggle("true", isTrue);
    name.textContent = (isTrue ? "true: " : "") + replays.classes[item.dataset.label];
    const value = of.belief[frame * classes + Number(item.dataset.label)] / 100;
    item.querySelector(".fill").style.width = `${value}%`;
    item.querySelector(".value").textContent = `${value.toFixed(0)} %`;
  }
}
