/** Pages in words about the certificate that `--lan` makes: for who meets the warning, and for who looks after devices. */

import { msg } from "@lit/localize";
import { html, render, type TemplateResult } from "lit";

export type HelpTopic = "warning" | "devices";

/** The page of a topic. It asks the server for nothing. */
export function helpPage(topic: HelpTopic, host: string): HTMLElement {
  const main = document.createElement("main");
  main.className = "lesson-plan help";
  document.title = topic === "warning" ? msg("The browser's warning · Esker") : msg("School devices · Esker");
  render(topic === "warning" ? warning(host) : devices(host), main);
  return main;
}

function warning(host: string): TemplateResult {
  return html`
    <nav><a href="/">Esker</a><span>${msg("For everybody")}</span></nav>
    <header>
      <h1>${msg("Your browser warns. Here that is expected.")}</h1>
      <p class="goal">${msg("This Esker runs on a computer near you and not on the Internet. It encrypts what you send with a certificate that it made itself. Your browser does not know that certificate, so it asks you once.")}</p>
    </header>
    <section>
      <h2>${msg("First look")}</h2>
      <ul>
        <li>${msg(html`The address begins with <b>https://${host}</b>, exactly as on the projector.`)}</li>
        <li>${msg("Nobody asks you for a password here. Type none.")}</li>
      </ul>
      <p>${msg("If both are so, go on. If the warning comes anywhere else, on a page that you use at home for example, go back: there it means that something is wrong.")}</p>
    </section>
    <section>
      <h2>${msg("Which button")}</h2>
      <dl class="browsers">
        <dt>${msg("Chrome, Chromebook, Android")}</dt>
        <dd>${msg(html`It says “Your connection is not private”. Press <b>Advanced</b>, then <b>Proceed to ${bare(host)} (unsafe)</b>.`)}</dd>
        <dt>${msg("Edge")}</dt>
        <dd>${msg(html`It says “Your connection isn't private”. Press <b>Advanced</b>, then <b>Continue to ${bare(host)} (unsafe)</b>.`)}</dd>
        <dt>${msg("Safari on iPad, iPhone, Mac")}</dt>
        <dd>${msg(html`It says “This Connection Is Not Private”. Press <b>Show Details</b>, then <b>visit this website</b>, then <b>Visit Website</b>. A Mac may ask for the password of that Mac; its owner types it.`)}</dd>
        <dt>${msg("Firefox")}</dt>
        <dd>${msg(html`It says “Potential Security Risk Ahead”, or that something does not look right. Press <b>Advanced</b>, then <b>Accept the Risk and Continue</b>, in newer ones <b>Proceed to ${bare(host)} (Risky)</b>.`)}</dd>
        <dt>${msg("There is no such button")}</dt>
        <dd>${msg(html`Whoever looks after these devices has switched it off. <a href="/help/devices">School devices</a> is a recipe for them; until then use another device.`)}</dd>
      </dl>
    </section>
    <section>
      <h2>${msg("Why it is safe here")}</h2>
      <p>${msg("The warning does not say that somebody listens. It says that no company has vouched for this address, and none can: addresses inside a school or a house are the same everywhere. Who vouches for it is the person who started Esker and shows you the address. What you send is encrypted all the same.")}</p>
      <p>${msg("Browsers draw in 3D, and take the pressure of a pen, on encrypted pages only. That is why Esker does not do without.")}</p>
    </section>
  `;
}

function devices(host: string): TemplateResult {
  return html`
    <nav><a href="/">Esker</a><span>${msg("For administrators")}</span></nav>
    <header>
      <h1>${msg("School devices, without a warning")}</h1>
      <p class="goal">${msg(html`With <code>--lan</code> Esker makes a certificate authority on the teacher's computer. Devices that trust it open <code>https://${host}</code> without asking. It is done once, and lasts for two years.`)}</p>
    </header>
    <section>
      <h2>${msg("The file")}</h2>
      <p>${msg(html`<code>esker-ca.pem</code>, a certificate in PEM. It lies in the folder <code>tls</code> of Esker's data folder on the teacher's computer, and <a href="/esker-ca.pem">this server gives it out</a>. Take it from the computer itself, or compare its fingerprint there:`)}</p>
      <pre>openssl x509 -in tls/esker-ca.pem -noout -fingerprint -sha256</pre>
      <p>${msg(html`The file beside it, <code>esker-ca.key</code>, never leaves that computer, and nobody needs it.`)}</p>
    </section>
    <section>
      <h2>${msg("What it can do")}</h2>
      <p>${msg(html`It vouches for private addresses alone (10.0.0.0/8, 172.16.0.0/12, 192.168.0.0/16, 169.254.0.0/16, 127.0.0.0/8, ::1, fc00::/7, fe80::/10), for the names <code>localhost</code>, <code>.local</code>, <code>.home.arpa</code> and <code>.internal</code>, and for the computer's own address where that is none of these. These limits are critical name constraints in the certificate: a browser refuses whatever it signs for any other site. It signs no further authority.`)}</p>
      <p>${msg("The address of the computer may change; the authority stays. Another computer, or a new data folder, has another one.")}</p>
    </section>
    <section>
      <h2>${msg("Managed Chromebooks")}</h2>
      <ol>
        <li>${msg(html`In the Google Admin console open <b>Devices › Networks › Certificates</b>, and choose the organisational unit of the pupils.`)}</li>
        <li>${msg(html`<b>Add certificate</b>: a name, such as “Esker in room 12”, and the file as it is. Chromebooks take PEM only.`)}</li>
        <li>${msg(html`Under <b>Certificate Authority</b> tick <b>Chromebook</b>. Press <b>Add</b>.`)}</li>
        <li>${msg(html`On a Chromebook open <code>chrome://policy</code> and press <b>Reload policies</b>, or sign in anew.`)}</li>
      </ol>
      <p>${msg(html`Without it: <b>Chrome › Settings › Users &amp; browsers</b> lets pupils pass the warning for origins that you list (<code>SSLErrorOverrideAllowedForOrigins</code>). List <code>https://${host}</code>.`)}</p>
    </section>
    <section>
      <h2>${msg("iPads")}</h2>
      <ol>
        <li>${msg(html`In your device management make a profile with a <b>Certificate</b> (root) and the file; name it <code>esker-ca.cer</code> where that is asked for.`)}</li>
        <li>${msg("Assign the profile to the iPads. What comes from a device management is trusted for websites at once.")}</li>
      </ol>
      <p>${msg(html`A single iPad, by hand: open <a href="/esker-ca.pem"><code>https://${host}/esker-ca.pem</code></a> in Safari and allow the download. Then <b>Settings › General › VPN &amp; Device Management</b>, install it; then <b>Settings › General › About › Certificate Trust Settings</b>, and switch it on. Without the last step it is installed and not trusted.`)}</p>
    </section>
    <section>
      <h2>${msg("Windows")}</h2>
      <ol>
        <li>${msg(html`With Active Directory: in a group policy open <b>Computer Configuration › Policies › Windows Settings › Security Settings › Public Key Policies › Trusted Root Certification Authorities</b>, then <b>Import</b>, and choose the file.`)}</li>
        <li>${msg(html`With Intune: <b>Devices › Configuration › Create › Templates › Trusted certificate</b>, the file named <code>esker-ca.cer</code>, into the computer's root store.`)}</li>
        <li>${msg("On one computer, in a prompt of an administrator:")}</li>
      </ol>
      <pre>certutil -addstore -f Root esker-ca.pem</pre>
      <p>${msg(html`Chrome and Edge take it from there, and Firefox too, unless a policy forbids it (<code>Certificates › ImportEnterpriseRoots</code>).`)}</p>
    </section>
    <section>
      <h2>${msg("When it is over")}</h2>
      <p>${msg(html`Remove it in the same place. It is called <b>Esker on this computer</b>. Esker says in its terminal when it has made a new one; the old one is then of no use.`)}</p>
      <p><a href="/help/warning">${msg("What pupils see without it")}</a></p>
    </section>
  `;
}

/** A host without its port: browsers name it so on their buttons. */
function bare(host: string): string {
  return host.replace(/:\d+$/, "");
}
