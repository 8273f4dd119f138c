// The people and the cameras in space, seen from a place that the reader turns: an orthographic view on a canvas.

const scene = { turn: -0.7, tilt: 0.42, zoom: 1 };

function projection(width, height, reach) {
  const [sin, cos] = [Math.sin(scene.turn), Math.cos(scene.turn)];
  const [up, along] = [Math.cos(scene.tilt), Math.sin(scene.tilt)];
  const whole = 0.93 * Math.min(width / (2 * reach), height / ((1 + along) * reach));
  const middle = height / 2 + (whole * reach * (1 - along)) / 2;
  const scale = scene.zoom * whole;
  return ([x, y, z]) => [
    width / 2 + scale * (cos * x - sin * y),
    middle - scale * (along * (sin * x + cos * y) + up * z),
  ];
}

function drawScene(canvas, episode, cast, frame) {
  const { pen, width, height } = prepared(canvas, 0.82);
  const { people, passers, centre } = decodedEpisode(episode);
  const reach = Math.max(...cast.flatMap(({ of }) => farthest(of.path)), replays.distances[0]);
  const at = projection(width, height, reach);
  const floor = lowest(people);
  if (centre === null) drawGround(pen, at, reach, floor);
  else drawWalkedGround(pen, at, reach, floor, centre, frame);
  drawDome(pen, at, reach);
  const here = centre === null ? [0, 0, 0] : centre.subarray(3 * frame, 3 * frame + 3);
  const standing = (point) => at(point.map((value, axis) => value - here[axis]));
  replays.obstacles.forEach((line) => stroke(pen, line.map(standing), colour("@neutral/0.9"), 1.2));
  if (passers !== null) drawPassers(pen, at, passers, frame);
  cast.forEach(({ of, look }) => (centre === null ? drawPath(pen, at, of, look, frame) : drawTrail(pen, at, of, look, centre, frame)));
  drawPeople(pen, at, people, frame);
  cast.forEach(({ of, look, name }, index) => drawCamera(pen, at, of, look, frame, name, index, reach));
}

function farthest(path) {
  const distances = [];
  for (let frame = 0; frame < replays.frames; frame += 1) distances.push(path[3 * frame]);
  return Math.max(...distances);
}

function lowest(people) {
  let low = Infinity;
  for (let index = 2; index < people.length; index += 3) if (people[index] < low) low = people[index];
  return low;
}

function ring(radius, height) {
  return Array.from({ length: 61 }, (_, step) => {
    const angle = (step * Math.PI) / 30;
    return [radius * Math.cos(angle), radius * Math.sin(angle), height];
  });
}

function drawGround(pen, at, reach, floor) {
  const step = reach < 5 ? 0.5 : 2.5;
  for (let metre = step; metre <= reach; metre += step) stroke(pen, ring(metre, floor).map(at), colour("@grid"), 1);
  pen.fillStyle = colour("@soft");
  for (let metre = 2 * step; metre <= reach; metre += 2 * step) pen.fillText(`${metre} m`, ...at([metre, 0, floor]));
}

const TRAIL = 5; // [s], of a camera's way in a stream
const WALKED = 10; // [s], of the centre's way

// In a stream everything is seen from the centre, which moves. So the ground moves below it: lines that stay where they
// are, and the way of the centre.
function drawWalkedGround(pen, at, reach, floor, centre, frame) {
  const step = reach < 5 ? 0.5 : 2.5;
  const here = centre.subarray(3 * frame, 3 * frame + 3);
  for (const axis of [0, 1]) {
    const first = Math.ceil((here[axis] - reach) / step);
    for (let line = first; line * step <= here[axis] + reach; line += 1) {
      const aside = line * step - here[axis];
      const half = Math.sqrt(Math.max(0, reach ** 2 - aside ** 2));
      const ends = [-half, half].map((along) => (axis ? [along, aside, floor] : [aside, along, floor]));
      stroke(pen, ends.map(at), colour("@grid"), line === 0 ? 2 : 1);
    }
  }
  stroke(pen, ring(reach, floor).map(at), colour("@grid"), 1);
  pen.fillStyle = colour("@soft");
  pen.fillText(`lines ${step} m apart`, 8, pen.canvas.clientHeight - 10);
  stroke(pen, pastOf(frame, WALKED * replays.fps).map((past) => at([...before(centre, past, here).slice(0, 2), floor])), colour("@text"), 1.5, [1, 4]);
  const [x, y] = at([0, 0, 0]);
  stroke(pen, [[x, y], at([0, 0, floor])], colour("@neutral"), 1, [2, 3]);
  pen.beginPath();
  pen.arc(x, y, 4, 0, 2 * Math.PI);
  pen.strokeStyle = colour("@neutral");
  pen.lineWidth = 1.5;
  pen.stroke();
}

// Frames up to one, from so many before it on.
const pastOf = (frame, frames) => Array.from({ length: Math.min(frame, Math.round(frames)) + 1 }, (_, back) => frame - back).reverse();

// Where the centre was, seen from where it is.
const before = (centre, past, here) => [0, 1, 2].map((axis) => centre[3 * past + axis] - here[axis]);

function drawTrail(pen, at, of, look, centre, frame) {
  const here = centre.subarray(3 * frame, 3 * frame + 3);
  const points = pastOf(frame, TRAIL * replays.fps).map((past) => {
    const moved = before(centre, past, here);
    return at(pointAt(of.path, past).map((value, axis) => value + moved[axis]));
  });
  stroke(pen, points, colour(look.colour), 3, look.dash);
}

// Half a sphere as far away as the farthest camera: its rim and two meridians.
function drawDome(pen, at, reach) {
  const arc = (azimuth) =>
    Array.from({ length: 31 }, (_, step) => {
      const polar = ((step - 15) * Math.PI) / 30;
      const level = reach * Math.sin(polar);
      return [level * Math.cos(azimuth), level * Math.sin(azimuth), reach * Math.cos(polar)];
    });
  for (const line of [ring(reach, 0), arc(0), arc(Math.PI / 2)]) {
    stroke(pen, line.map(at), colour("@neutral/0.45"), 1, [2, 4]);
  }
}

function drawPath(pen, at, of, look, frame) {
  const points = Array.from({ length: replays.frames }, (_, step) => at(pointAt(of.path, step)));
  stroke(pen, points, colour(`${look.colour}/0.35`), 2);
  stroke(pen, points.slice(0, frame + 1), colour(look.colour), 3.5, look.dash);
}

// Where the tracker lost people, their joints are NaN, and a canvas draws no line to NaN.
function drawPeople(pen, at, people, frame) {
  for (let who = 0; who < replays.persons; who += 1) {
    const [tint, dash] = person(who);
    drawBones(pen, at, people, frame * replays.persons + who, colour(tint), dash);
  }
}

function drawPassers(pen, at, passers, frame) {
  const many = passers.length / (3 * replays.joints * replays.frames);
  for (let who = 0; who < many; who += 1) drawBones(pen, at, passers, frame * many + who, colour("@neutral/0.9"), []);
}

function drawBones(pen, at, bodies, index, tint, dash) {
  const first = 3 * replays.joints * index;
  const joint = (number) => at([...bodies.subarray(first + 3 * number, first + 3 * number + 3)]);
  for (const [from, to] of replays.bones) stroke(pen, [joint(from), joint(to)], tint, 2.2, dash);
}

function drawCamera(pen, at, of, look, frame, name, index, reach) {
  const tint = colour(look.colour);
  const here = pointAt(of.path, frame);
  const wanted = of.target === null || frame >= replays.frames - 1 ? null : pointAt(of.target, frame);
  stroke(pen, [at(here), at([0, 0, 0])], colour(`${look.colour}/0.5`), 1, [3, 4]);
  if (wanted !== null) {
    stroke(pen, [at(here), at(wanted)], tint, 1.5, [1, 4]);
    diamond(pen, at(wanted), 7, tint);
  }
  drawBody(pen, at, of.path.subarray(3 * frame, 3 * frame + 3), here, tint, Math.min(1, reach / 5));
  const [x, y] = at(here);
  pen.fillStyle = colour("@text");
  const [room, wide] = [pen.canvas.clientWidth, pen.measureText(name).width];
  const left = x + (index ? -12 - wide : 12);
  pen.fillText(name, Math.max(4, Math.min(room - wide - 4, left)), index ? y + 18 : y - 10);
}

// A pyramid that opens towards the people.
function drawBody(pen, at, [, azimuth, polar], here, tint, size) {
  const right = [-Math.sin(azimuth), Math.cos(azimuth), 0];
  const down = [Math.cos(polar) * Math.cos(azimuth), Math.cos(polar) * Math.sin(azimuth), -Math.sin(polar)];
  const length = Math.hypot(...here);
  const corner = (across, along) =>
    at(here.map((value, axis) => value + size * ((-0.7 * value) / length + 0.42 * across * right[axis] + 0.24 * along * down[axis])));
  const frame = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1), corner(-1, -1)];
  stroke(pen, frame, tint, 2);
  frame.slice(0, 4).forEach((place) => stroke(pen, [at(here), place], tint, 2));
  dot(pen, at(here), 5, tint);
}

// Drag, arrow keys and the buttons turn the view.
function steerScene(canvas, redraw) {
  const turn = (dx, dy) => {
    scene.turn += dx;
    scene.tilt = Math.min(Math.PI / 2, Math.max(0, scene.tilt + dy));
    redraw();
  };
  const zoom = (by) => {
    scene.zoom = Math.min(8, Math.max(0.6, scene.zoom * by));
    redraw();
  };
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons & 1) turn(0.01 * event.movementX, event.pointerType === "touch" ? 0 : 0.01 * event.movementY);
  });
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    if (event.key in steps) turn(...steps[event.key]);
    else if (event.key === "+" || event.key === "-") zoom(event.key === "+" ? 1.25 : 0.8);
    else return;
    event.preventDefault();
  });
  byId("zoom-in").addEventListener("click", () => zoom(1.25));
  byId("zoom-out").addEventListener("click", () => zoom(0.8));
}
