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
  new ResizeObserver(drawFrame).observe(byId("stage"));
  stage();
}

const episodeShown = () => replays.episodes[Number(byId("episode").value)];

function castShown() {
  const { cast } = decodedEpisode(episodeShown());
  const names = [byId("first").value, byId("second").value].filter((name) => name !== "");
  return [...new Set(names)].map((name, index) => ({ name, of: cast[name], look: LOOKS[index] }));
}

// Set up one column a planner.
function stage() {
  const { label, why } = episodeShown();
  const cast = castShown();
  byId("why").textContent = `True class: ${replays.classes[label]}. Why this one: ${why}.`;
  const labels = shownClasses(cast, label);
  byId("cast").replaceChildren(...cast.map((one) => column(one, labels, label)));
  show(Math.min(player.frame, replays.frames - 1));
}

function column({ name, of, look }, labels, label) {
  const box = byId("column").content.firstElementChild.cloneNode(true);
  box.style.setProperty("--mine", `var(--c${look.colour.slice(1)})`);
  box.querySelector("h3").textContent = name;
  box.querySelector(".image").setAttribute("aria-label", `What the camera of ${name} sees`);
  box.querySelector(".map").setAttribute("aria-label", `Directions, and the path of ${name}`);
  box.querySelector(".legend").textContent =
    of.field === null
      ? "Azimuth across, polar angle down: 0° above, 90° level. This planner has no gain field."
      : `Azimuth across, polar angle down. Bluer is worth more at this distance (${of.field.low} to ${of.field.high} % over the episode, against here).`;
  box.querySelector(".beliefs").append(...labels.map((one) => bar(one, one === label)));
  return box;
}

function bar(label, isTrue) {
  const item = byId("belief").content.firstElementChild.cloneNode(true);
  item.dataset.label = label;
  const name = item.querySelector(".name");
  name.textContent = (isTrue ? "true: " : "") + replays.classes[label];
  name.title = replays.classes[label];
  name.classList.toggle("true", isTrue);
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
  drawScene(byId("scene"), episode, cast, frame);
  drawCourse(byId("course"), cast, episode.label, frame);
  cast.forEach(({ of, look }, index) => {
    const box = byId("cast").children[index];
    drawImage(box.querySelector(".image"), of, frame);
    drawMap(box.querySelector(".map"), of, look, frame);
    fillBeliefs(box.querySelector(".beliefs"), of, frame);
    box.querySelector(".where").textContent = whereabouts(of, frame);
  });
  const text = `frame ${frame + 1} of ${replays.frames}, ${((frame + 1) / replays.fps).toFixed(2)} s`;
  byId("frame").textContent = text;
  byId("scrub").setAttribute("aria-valuetext", text);
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
