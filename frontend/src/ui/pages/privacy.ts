import { msg } from "@lit/localize";
import { html, render } from "lit";

/** What this server knows of people, in words for pupils, parents and schools. */
export function privacyPage(): HTMLElement {
  const main = document.createElement("main");
  main.className = "missing privacy";
  document.title = msg("What is known of people · Esker");
  render(
    html`
      <img src="/favicon.svg" alt="" width="52" height="52" />
      <h1>${msg("What is known of people here")}</h1>
      <p>${msg(html`<strong>Nothing leaves this server.</strong> The page asks no other computer for anything: no fonts, no pictures, no statistics. It sets no cookies. This browser remembers, for itself, the terrains that it opened, a name and a colour.`)}</p>
      <p>${msg(html`<strong>There are no accounts.</strong> Nobody types an address, a birthday or a password. A link or a code opens a terrain, and that is all.`)}</p>
      <p>${msg(html`<strong>Names are as you choose.</strong> Whoever leads a lesson can hide them, or have the server call everybody after an animal; names that somebody types are then neither shown nor kept.`)}</p>
      <p>${msg(html`<strong>What is kept</strong> is the land: its lines, when each was drawn, and the name of who drew it, on the disk of whoever runs this server. Of somebody who was sent out of a lesson the network address is kept until they are let in. Groups that whoever leads makes are kept with the lesson, and shown to nobody else.`)}</p>
      <p>${msg(html`<strong>It can be deleted.</strong> Whoever owns a terrain deletes it in its menu; a week later nothing of it is left here but in backups, which go too.`)}</p>
      <p><a href="/">${msg("Go to the start page")}</a></p>
    `,
    main,
  );
  return main;
}
