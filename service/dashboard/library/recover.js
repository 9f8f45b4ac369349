/** Reload the page when its modules could not be loaded, for example during an upgrade of the service. */

(() => {
  const WAIT_MS = 1000;

  async function reload() {
    try {
      const answer = await fetch("/", { cache: "no-store" });
      if (answer.ok) return location.reload();
    } catch {
      // the service is not there yet
    }
    return setTimeout(reload, WAIT_MS);
  }

  const retry = (event) => event.target.id === "app" && setTimeout(reload, WAIT_MS);
  document.addEventListener("error", retry, true); // of the script element; it does not bubble
})();
