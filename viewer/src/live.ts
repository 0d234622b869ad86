// A page that a server sends, and sends news to: what has been built again, and what is wrong.

import type { BufferGeometry } from "three";
import type { Place, Robot } from "./data";
import { bytesOf, geometriesOf } from "./scene";
import { $, make } from "./ui/dom";
import { place } from "./ui/place";
import type { Viewer } from "./viewer";

interface Finding extends Place { code: string; severity: string; message: string; help: string | null; notes: ({ message: string } & Place)[] }
interface News { build: number; seconds: number; findings: Finding[] }

export const live = (): boolean => document.querySelector('meta[name="thingc-live"]') !== null;

/** Listens as long as the page is open; the browser connects again by itself. */
export function listen(viewer: Viewer, update: (robot: Robot, geometries: BufferGeometry[]) => void): void {
  const events = new EventSource("events");
  let build = 0;
  events.onmessage = async (message) => {
    const news = JSON.parse(message.data) as News;
    findings(news.findings);
    if (news.findings.length > 0) viewer.say("");
    if (news.build === build) return;
    build = news.build;
    const { robot, geometry } = await fetch("robot.json").then((answer) => answer.json() as Promise<{ robot: Robot; geometry: string }>);
    if (news.build !== build) return; // there is a newer one already
    update(robot, await geometriesOf(bytesOf(geometry)));
    if (news.findings.length === 0) viewer.say(`built in ${news.seconds.toFixed(2)} s`);
  };
  events.onerror = () => viewer.say("thingc view is not there any more: start it again, and take the address that it prints");
}

function findings(list: Finding[]): void {
  const own = $("findings");
  own.hidden = list.length === 0;
  own.replaceChildren(...list.map(({ code, severity, message, file, line, help, notes }) => {
    const at = (where: Place): (Node | string)[] => { const node = place(where); return node === null ? [] : [" ", node]; };
    const said = notes.flatMap((note) => [make("br"), make("span", { class: "soft" }, `note: ${note.message}`), ...at(note)]);
    return make("p", {}, make("strong", {}, `${severity} ${code}: `), message, ...at({ file, line }), ...said,
      ...(help === null ? [] : [make("br"), make("span", { class: "soft" }, `help: ${help}`)]));
  }));
}
