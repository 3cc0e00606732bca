// Every canvas draws its own cloud; z is up, and dragging rotates it.
"use strict";
for (const canvas of document.querySelectorAll("canvas.cloud")) {
  const numbers = canvas.dataset.points.split(" ").map(Number);
  const palette = canvas.dataset.palette.split(" ");
  const [small, large] = canvas.dataset.radii.split(" ").map(Number);
  const context = canvas.getContext("2d");
  let azimuth = 0.6, elevation = Number(canvas.dataset.elevation), from = null;
  const draw = () => {
    const { width, height } = canvas, scale = 0.45 * Math.min(width, height) / 1000;
    context.clearRect(0, 0, width, height);
    const points = [];
    for (let i = 0; 3 * i < numbers.length; i++) {
      const [x, y, z] = numbers.slice(3 * i, 3 * i + 3);
      const across = x * Math.cos(azimuth) + y * Math.sin(azimuth);
      const along = y * Math.cos(azimuth) - x * Math.sin(azimuth);
      const up = z * Math.cos(elevation) + along * Math.sin(elevation);
      const depth = along * Math.cos(elevation) - z * Math.sin(elevation);
      points.push([depth, width / 2 + scale * across, height / 2 - scale * up, canvas.dataset.colours[i]]);
    }
    points.sort((a, b) => b[0] - a[0]);
    for (const [, x, y, colour] of points) {
      context.fillStyle = palette[colour];
      context.beginPath();
      context.arc(x, y, colour === "0" ? small : large, 0, 2 * Math.PI);
      context.fill();
    }
  };
  canvas.addEventListener("pointerdown", (event) => {
    from = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (from === null) return;
    azimuth += (event.clientX - from[0]) / 120;
    elevation = Math.max(-1.5, Math.min(1.5, elevation + (event.clientY - from[1]) / 120));
    from = [event.clientX, event.clientY];
    draw();
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { from = null; });
  draw();
}
