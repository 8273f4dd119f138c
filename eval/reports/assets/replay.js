// The replay: an episode, up to two planners, and a frame.

const replays = parsed("replays");
const LOOKS = [{ colour: "@0", dash: [] }, { colour: "@1", dash: [8, 5] }];
const player = { frame: 0, since: null, from: 0 };

function startReplay() {
  const pickers = [byId("episode"), byId("first"), byId("second")];
  pickers.forEach((picker) => picker.addEventListener("change", stage));
  byId("scrub").addEventListener("input", () => show(Number(byId("scrub").value)));
  byId("play").addEventListener("click", () => (player.since === null ? play() : pause()));
  steerScene(byId("scene"), drawFrame);
  dark.addEventListener("change", drawFrame);
  if (replays.streams) steerStream();
  new ResizeObserver(drawFrame).observe(byId("stage"));
  stage();
}

// A click on the timeline goes there.
function steerStream() {
  const course = byId("course");
  course.classList.add("stream");
  const seek = (event) => {
    if (!(event.buttons & 1)) return;
    pause();
    show(Math.min(replays.frames - 1, Math.round(frameAt(course, event) / spread())));
  };
  course.addEventListener("pointerdown", seek);
  course.addEventListener("pointermove", seek);
}

const episodeShown = () => replays.episodes[Number(byId("episode").value)];

function castShown() {
  const { cast } = decodedEpisode(episodeShown());
  const names = [byId("first").value, byId("second").value].filter((name) => name !== "");
  return [...new Set(names)].map((name, index) => ({ name, of: cast[name], look: LOOKS[index] }));
}

// Set up one column a planner.
function stage() {
  const { why } = episodeShown();
  const { labels } = decodedEpisode(episodeShown());
  const cast = castShown();
  const truth = replays.streams ? "" : `True class: ${replays.classes[labels[0]]}. `;
  byId("why").textContent = `${truth}Why this one: ${why}.`;
  const shown = shownClasses(cast, labels);
  byId("cast").replaceChildren(...cast.map((one) => column(one, shown)));
  show(Math.min(player.frame, replays.frames - 1));
}

function column({ name, of, look }, labels) {
  const box = byId("column").content.firstElementChild.cloneNode(true);
  box.style.setProperty("--mine", `var(--c${look.colour.slice(1)})`);
  box.querySelector("h3").textContent = name;
  box.querySelector(".answer").hidden = !replays.streams;
  box.querySelector(".image").setAttribute("aria-label", `What the camera of ${name} sees`);
  box.querySelector(".map").setAttribute("aria-label", `Directions, and the path of ${name}`);
  box.querySelector(".legend").textContent =
    of.field === null
      ? "Azimuth across, polar angle down: 0° above, 90° level. This planner has no gain field."
      : `Azimuth across, polar angle down. Bluer is worth more at this distance (${of.field.low} to ${of.field.high} % over the episode, against here).`;
  box.querySelector(".beliefs").append(...labels.map(bar));
  return box;
}

function bar(label) {
  const item = byId("belief").content.firstElementChild.cloneNode(true);
  item.dataset.label = label;
  item.querySelector(".name").title = replays.classes[label];
  return item;
}

function show(frame) {
  player.frame = frame;
  byId("scrub").value = frame;
  drawFrame();
}

function drawFrame() {
  const { frame } = player;
  const episode = episodeShown();
  const cast = castShown();
  const { labels } = decodedEpisode(episode);
  const label = labels[frame];
  drawScene(byId("scene"), episode, cast, frame);
  if (replays.streams) drawTimeline(byId("course"), lineOf(episode.episode), cast, frame * spread());
  else drawCourse(byId("course"), cast, labels, frame);
  cast.forEach(({ of, look }, index) => {
    const box = byId("cast").children[index];
    drawImage(box.querySelector(".image"), of, frame);
    drawMap(box.querySelector(".map"), of, look, frame);
    fillBeliefs(box.querySelector(".beliefs"), of, frame, label);
    if (replays.streams) fillAnswer(box.querySelector(".answer"), of, frame, label);
    box.querySelector(".where").textContent = whereabouts(of, frame);
  });
  const text = replays.streams
    ? `${(frame / replays.fps).toFixed(1)} s of ${(replays.frames / replays.fps).toFixed(0)} s, shown: ${replays.classes[label]}`
    : `frame ${frame + 1} of ${replays.frames}, ${((frame + 1) / replays.fps).toFixed(2)} s`;
  byId("frame").textContent = text;
  byId("scrub").setAttribute("aria-valuetext", text);
}

// How many frames of the episode lie between two that are shown.
const spread = () => lines.fps / replays.fps;

function fillAnswer(place, of, frame, label) {
  const classes = replays.classes.length;
  const believed = of.belief.subarray(frame * classes, (frame + 1) * classes);
  const said = believed.indexOf(Math.max(...believed));
  place.textContent = `answers ${replays.classes[said]}`;
  place.classList.toggle("right", said === label);
  place.classList.toggle("wrong", said !== label);
}

function whereabouts(of, frame) {
  const [distance, azimuth, polar] = of.path.subarray(3 * frame, 3 * frame + 3);
  const degrees = (angle) => Math.round((angle * 180) / Math.PI);
  return `at ${distance.toFixed(1)} m, azimuth ${degrees(azimuth)}°, polar ${degrees(polar)}°`;
}

function play() {
  player.from = player.frame === replays.frames - 1 ? 0 : player.frame;
  player.since = performance.now();
  byId("play").textContent = "Pause";
  requestAnimationFrame(advance);
}

function pause() {
  player.since = null;
  byId("play").textContent = "Play";
}

function advance(now) {
  if (player.since === null) return;
  const frame = player.from + Math.floor((Math.max(0, now - player.since) / 1000) * replays.fps);
  if (frame >= replays.frames - 1) {
    show(replays.frames - 1);
    pause();
    return;
  }
  if (frame !== player.frame) show(frame);
  requestAnimationFrame(advance);
}

if (replays.episodes.length) startReplay();
