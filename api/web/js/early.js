// Runs before anything is painted, so that a page set to dark does not flash white.
{
  let chosen = null;
  try {
    chosen = localStorage.getItem("rcsa.theme");
  } catch {
    // a browser that keeps nothing
  }
  if (chosen === "light" || chosen === "dark") document.documentElement.dataset.theme = chosen;
}
