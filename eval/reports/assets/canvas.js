// A canvas in CSS pixels, sharp on every screen, and the few things that all views draw.

function prepared(canvas, aspect) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth || 300;
  const height = Math.round(width * aspect);
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    canvas.style.height = `${height}px`;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.lineCap = pen.lineJoin = "round";
  pen.font = "12px system-ui, sans-serif";
  return { pen, width, height };
}

function stroke(pen, points, style, width = 1.5, dash = []) {
  pen.beginPath();
  points.forEach(([x, y], at) => (at ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  pen.strokeStyle = style;
  pen.lineWidth = width;
  pen.setLineDash(dash);
  pen.stroke();
  pen.setLineDash([]);
}

function dot(pen, [x, y], radius, style) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = style;
  pen.fill();
}

function diamond(pen, [x, y], radius, style) {
  const corners = [[0, -radius], [radius, 0], [0, radius], [-radius, 0], [0, -radius]];
  stroke(pen, corners.map(([dx, dy]) => [x + dx, y + dy]), style, 2.5);
}

// Persons differ by colour and by dash.
const PERSONS = [["@text", []], ["@5", [5, 3]], ["@2", [2, 3]], ["@3", [8, 3]]];
const person = (index) => PERSONS[index % PERSONS.length];
