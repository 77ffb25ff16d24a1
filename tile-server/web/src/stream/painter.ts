//! Marks over pictures: what is drawn on the globe and the camera in, the same on a canvas out; what the globe hides is left out.
import type { Drawn } from "../globe/drawn";
import { isHidden, onGround, type Point, type Pose, seen } from "./pose";

export function paint(paper: CanvasRenderingContext2D, pose: Pose, all: readonly Drawn[]): void {
  paper.lineJoin = "round";
  for (const { lines, points } of all) {
    const at = ({ lon, lat }: { lon: number; lat: number }): Point | undefined => {
      // No facets of a globe can cut into them here: they lie where they belong.
      const place = onGround(lon, lat);
      return isHidden(pose, place) ? undefined : seen(pose, place);
    };
    for (const line of lines) {
      paper.beginPath();
      let isDown = false;
      for (const point of line.points.map(at)) {
        if (point && isDown) paper.lineTo(point.x, point.y);
        else if (point) paper.moveTo(point.x, point.y);
        isDown = point !== undefined;
      }
      paper.strokeStyle = line.colour;
      paper.lineWidth = line.widthPx;
      paper.stroke();
    }
    for (const mark of points) {
      const point = at(mark);
      if (!point) continue;
      paper.beginPath();
      paper.arc(point.x, point.y, (mark.sizePx + mark.edgePx) / 2, 0, 2 * Math.PI);
      paper.fillStyle = mark.colour;
      paper.fill();
      paper.strokeStyle = mark.edge;
      paper.lineWidth = mark.edgePx;
      paper.stroke();
    }
  }
}
