// Browsers let no page of a file read the index of the search: say what does.
document.addEventListener("DOMContentLoaded", () => {
  const results = document.getElementById("mkdocs-search-results");
  if (results && location.protocol === "file:")
    results.textContent =
      "The search needs a server: python3 -m http.server --bind 127.0.0.1 -d build/site, then http://127.0.0.1:8000.";
});
