// The connection to `thingc view`, which sends new builds and diagnostics.

import type { BufferGeometry } from "three";
import { type Place, type Robot, VERSION } from "./data";
import { bytesOf, geometriesOf } from "./scene";
import { $, make } from "./ui/dom";
import { place } from "./ui/place";
import { preferred, type Viewer } from "./viewer";

interface Finding extends Place { code: string; severity: string; message: string; help: string | null; notes: ({ message: string } & Place)[] }
interface News { run: string; build: number; against: number; seconds: number; findings: Finding[] }

/** A robot and its meshes from the server; null if there is none. */
export type Sent = { robot: Robot; geometries: BufferGeometry[] } | null;

/** The delay [ms] before the page reconnects, for browsers that do not reconnect by themselves. */
const AGAIN = 2000;

const stand = (): string | undefined => document.querySelector<HTMLMetaElement>('meta[name="thingc-live"]')?.content;

export const live = (): boolean => stand() !== undefined;

/** Receives updates as long as the page is open, also from the next server on the same port. */
export function listen(viewer: Viewer, update: (sent: Sent) => void, against: (sent: Sent) => void): void {
  const [run, builds, others] = stand()!.split(" ");
  let seen: Pick<News, "run" | "build" | "against"> = { run, build: Number(builds), against: Number(others) };
  const fresh = async (name: string, number: "build" | "against", news: News, take: (sent: Sent) => void): Promise<boolean> => {
    if (news.run === seen.run && news[number] === seen[number]) return false;
    const sent = await (news[number] === 0 ? null : fetched(name));
    if (seen.run !== news.run || seen[number] !== news[number]) return false; // a newer build has arrived
    take(sent);
    return sent !== null;
  };
  follow(async (news) => {
    if (news.findings.length > 0) viewer.showMessage("");
    const taken = Promise.all([fresh("robot.json", "build", news, update), fresh("against.json", "against", news, against)]);
    seen = news;
    if ((await taken).includes(true) && news.findings.length === 0) viewer.showMessage(`Built in ${news.seconds.toFixed(2)} s`);
  });
}

/** Shows diagnostics until the first build, then reloads the page. */
export function wait(): void {
  document.documentElement.dataset.theme = preferred();
  $("panels").hidden = true;
  document.body.classList.add("waiting");
  $("title").textContent = document.title;
  $("view").append(make("p", { id: "waiting" }, "Waiting for the first build. The robot appears here when the document has no errors."));
  follow((news) => { if (news.build > 0) location.reload(); });
}

async function fetched(name: string): Promise<Sent> {
  const { robot, geometry } = await fetch(name).then((answer) => answer.json() as Promise<{ robot: Robot; geometry: string }>);
  if (robot.version !== VERSION) location.reload(); // sent by another version of thingc
  return { robot, geometries: await geometriesOf(bytesOf(geometry)) };
}

/** Receives every build, shows its diagnostics, and shows a message if the connection is lost. */
function follow(heard: (news: News) => void): void {
  const gone = make("output", { id: "gone", hidden: true }, `thingc view has stopped. To reconnect, run it again with --port ${location.port}`);
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
      if (events.readyState === EventSource.CLOSED) setTimeout(connect, AGAIN); // otherwise the browser reconnects by itself
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
