import { msg, str } from "@lit/localize";
import { html, render, type TemplateResult } from "lit";
import { ApiError, api, type LessonPlan } from "../../app/server/api.ts";

/** A lesson for its teacher: goal, minutes, steps, what to ask. One plan of paper when it is printed. */
export function lessonPage(id: string): HTMLElement {
  const main = document.createElement("main");
  main.className = "lesson-plan";
  document.title = msg("A lesson · Esker");
  const show = (content: TemplateResult): void => {
    render(content, main);
  };
  show(html`<p role="status">${msg("Opening the lesson…")}</p>`);
  api.lesson(id).then(
    (lesson) => {
      document.title = `${lesson.title} · Esker`;
      show(plan(lesson, (why) => show(html`${plan(lesson, () => {})}<p role="alert">${why}</p>`)));
    },
    (error: unknown) =>
      show(
        html`<h1>${msg("This lesson is not here.")}</h1><p>${sentence(error)}</p><p><a href="/">${msg("Go to the start page")}</a></p>`,
      ),
  );
  return main;
}

function plan(lesson: LessonPlan, failed: (why: string) => void): TemplateResult {
  const start = (): void => {
    api.create(lesson.id).then(
      (made) => window.location.assign(`/t/${made.id}#${encodeURIComponent(made.secret)}`),
      (error: unknown) => failed(sentence(error)),
    );
  };
  return html`
    <nav><a href="/">Esker</a><span>${msg("For teachers")}</span></nav>
    <header>
      <h1>${lesson.title}</h1>
      <p class="facts">${msg(str`${lesson.minutes} minutes · age ${lesson.ages}`)}</p>
      <p class="goal">${lesson.goal}</p>
      <p class="doing">
        <button class="btn primary" @click=${start}>${msg("Start this lesson")}</button>
        <button class="btn" @click=${() => window.print()}>${msg("Print this plan")}</button>
      </p>
    </header>
    <img src=${`/templates/${lesson.id}.webp`} alt=${msg("The land of this lesson, as it can become")} @error=${(e: Event) => (e.target as Element).remove()} />
    <section>
      <h2>${msg("Before")}</h2>
      <ul>${lesson.before.map((each) => html`<li>${each}</li>`)}</ul>
    </section>
    <section>
      <h2>${msg("Steps")}</h2>
      <ol class="steps">
        ${lesson.steps.map(({ minutes, what }) => html`<li><b>${minutes} min</b><span>${what}</span></li>`)}
      </ol>
    </section>
    <section>
      <h2>${msg("What to ask")}</h2>
      <dl>${lesson.ask.map(({ question, answer }) => html`<dt>${question}</dt><dd>${answer}</dd>`)}</dl>
    </section>
    <section>
      <h2>${msg("What pupils read")}</h2>
      <blockquote>${lesson.task.split("\n\n").map((each) => html`<p>${each}</p>`)}</blockquote>
    </section>
    <section>
      <h2>${msg("What is real here")}</h2>
      <p>${lesson.truth}</p>
    </section>
  `;
}

function sentence(error: unknown): string {
  return error instanceof ApiError ? error.message : msg("Something went wrong. Reload the page and try again.");
}
