// A page that a server sends, and sends news to: what has been built again, and what is wrong.

import type { BufferGeometry } from "three";
import type { Robot } from "./data";
import { bytesOf, geometriesOf } from "./scene";
import { $, make } from "./ui/dom";
import { place } from "./ui/place";
import type { Viewer } from "./viewer";

interface Finding { code: string; severity: string; message: string; file: string | null; line: number | null; help: string | null }
interface News { build: number; seconds: number; findings: Finding[] }

export const live = (): boolean => document.querySelector('meta[name="thingc-live"]') !== null;

/** Listens as long as the page is open; the browser connects again by itself. */
export function listen(viewer: Viewer, update: (robot: Robot, geometries: BufferGeometry[]) => void): void {
  const events = new EventSource("events");
  let build = 0;
  events.onmessage = async (message) => {
    const news = JSON.parse(message.data) as News;
    findings(news.findings);
    if (news.build === build) return;
    build = news.build;
    const { robot, geometry } = await fetch("robot.json").then((answer) => answer.json() as Promise<{ robot: Robot; geometry: string }>);
    if (news.build !== build) return; // there is a newer one already
    update(robot, await geometriesOf(bytesOf(geometry)));
    viewer.say(`built in ${news.seconds.toFixed(2)} s`);
  };
  events.onerror = () => viewer.say("thingc view is not there any more: start it again");
}

function findings(list: Finding[]): void {
  const own = $("findings");
  own.hidden = list.length === 0;
  own.replaceChildren(...list.map(({ code, severity, message, file, line, help }) => {
    const where = place({ file, line });
    return make("p", {}, make("strong", {}, `${severity} ${code}: `), message, ...(where === null ? [] : [" ", where]),
      ...(help === null ? [] : [make("br"), make("span", { class: "soft" }, help)]));
  }));
}
