// A page that a server sends, and sends news to: what has been built again, and what is wrong.

import type { BufferGeometry } from "three";
import { type Place, type Robot, VERSION } from "./data";
import { bytesOf, geometriesOf } from "./scene";
import { $, make } from "./ui/dom";
import { place } from "./ui/place";
import { preferred, type Viewer } from "./viewer";

interface Finding extends Place { code: string; severity: string; message: string; help: string | null; notes: ({ message: string } & Place)[] }
interface News { run: string; build: number; against: number; seconds: number; findings: Finding[] }

/** A robot and its meshes, as a server sends them; null where it has none. */
export type Sent = { robot: Robot; geometries: BufferGeometry[] } | null;

/** After how long [ms] a page looks again for a server that has gone, where its browser does not by itself. */
const AGAIN = 2000;

const stand = (): string | undefined => document.querySelector<HTMLMetaElement>('meta[name="thingc-live"]')?.content;

export const live = (): boolean => stand() !== undefined;

/** Takes what is new as long as the page is open, of the next server on the same port, too. */
export function listen(viewer: Viewer, update: (sent: Sent) => void, against: (sent: Sent) => void): void {
  const [run, builds, others] = stand()!.split(" ");
  let seen: Pick<News, "run" | "build" | "against"> = { run, build: Number(builds), against: Number(others) };
  const fresh = async (name: string, number: "build" | "against", news: News, take: (sent: Sent) => void): Promise<boolean> => {
    if (news.run === seen.run && news[number] === seen[number]) return false;
    const sent = await (news[number] === 0 ? null : fetched(name));
    if (seen.run !== news.run || seen[number] !== news[number]) return false; // there is a newer one already
    take(sent);
    return sent !== null;
  };
  follow(async (news) => {
    if (news.findings.length > 0) viewer.say("");
    const taken = Promise.all([fresh("robot.json", "build", news, update), fresh("against.json", "against", news, against)]);
    seen = news;
    if ((await taken).includes(true) && news.findings.length === 0) viewer.say(`built in ${news.seconds.toFixed(2)} s`);
  });
}

/** Waits for the first robot, with what is wrong so far, and loads the page anew with it. */
export function wait(): void {
  document.documentElement.dataset.theme = preferred();
  $("panels").hidden = true;
  document.body.classList.add("waiting");
  $("title").textContent = document.title;
  $("view").append(make("p", { id: "waiting" }, "Nothing is built yet. The robot comes by itself when its document has no errors."));
  follow((news) => { if (news.build > 0) location.reload(); });
}

async function fetched(name: string): Promise<Sent> {
  const { robot, geometry } = await fetch(name).then((answer) => answer.json() as Promise<{ robot: Robot; geometry: string }>);
  if (robot.version !== VERSION) location.reload(); // of another thingc
  return { robot, geometries: await geometriesOf(bytesOf(geometry)) };
}

/** Hears of every round, and shows what was found in it, and that there is nobody any more who would tell. */
function follow(heard: (news: News) => void): void {
  const gone = make("output", { id: "gone", hidden: true }, `thingc view has ended: start it again with --port ${location.port}, and this page goes on`);
  $("view").append(gone);
  const connect = (): void => {
    const events = new EventSource("events");
    events.onopen = () => { gone.hidden = true; };
    events.onmessage = (message) => {
      const news = JSON.parse(message.data) as News;
      findings(news.findings);
      heard(news);
    };
    events.onerror = () => {
      gone.hidden = false;
      if (events.readyState === EventSource.CLOSED) setTimeout(connect, AGAIN); // else the browser connects again by itself
    };
  };
  connect();
}

function findings(list: Finding[]): void {
  const own = $("findings");
  own.hidden = list.length === 0;
  own.classList.toggle("mild", list.every(({ severity }) => severity !== "error"));
  own.replaceChildren(...list.map(({ code, severity, message, file, line, help, notes }) => {
    const at = (where: Place): (Node | string)[] => { const node = place(where); return node === null ? [] : [" ", node]; };
    const said = notes.flatMap((note) => [make("br"), make("span", { class: "soft" }, `note: ${note.message}`), ...at(note)]);
    return make("p", {}, make("strong", {}, `${severity} ${code}: `), message, ...at({ file, line }), ...said,
      ...(help === null ? [] : [make("br"), make("span", { class: "soft" }, `help: ${help}`)]));
  }));
}
