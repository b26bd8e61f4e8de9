// The theme searches in a web worker. This script, loaded before the theme's, changes two things:
// 1. Browsers start no workers for a page opened as a file. There, run the worker's script in a hidden frame.
// 2. Find pages that have all words of a query, in any form of the word. If there are none, find pages that have any.
(() => {
  const QUERY = 2, RESULT = 3; // types of the theme's messages
  const COMMON = new Set(
    ("a about again all am an and any are as at be but by can could did do does for from get give had has have how i if" +
      " in into is it its just large like many me much must my need no not of on only or our own please should so some" +
      " tell tells than that the their them then there these they this to too us was we were what when where which" +
      " while who why will with would you your").split(" "),
  );
  const ENDINGS = [["ations", 4], ["ation", 4], ["ings", 4], ["ing", 4], ["ions", 4], ["ion", 4], ["ies", 3], ["ed", 4],
    ["es", 4], ["e", 4], ["y", 3], ["s", 3]]; // and how much of a word must be left without it

  function stem(word) {
    const [ending] = ENDINGS.find(([end, least]) => word.endsWith(end) && word.length - end.length >= least) || [""];
    return word.slice(0, word.length - ending.length);
  }

  function stems(query) {
    const words = query.toLowerCase().replace(/'s\b/g, "").split(/[^\p{L}\p{N}]+/u).filter(Boolean);
    const telling = words.filter((word) => !COMMON.has(word));
    return (telling.length ? telling : words).map(stem);
  }

  function withAllWords(pages) {
    const found = pages.filter((sections) => {
      const terms = Object.assign({}, ...sections.map((s) => s.terms));
      return Object.keys(terms).every((term) => sections.some((s) => s.terms[term]));
    });
    return found.length ? found : pages;
  }

  class FrameWorker extends EventTarget {
    constructor(url) {
      super();
      window.IFrameWorker = FrameWorker; // tells the theme's script that it runs in a frame
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.append(frame);
      this.inner = frame.contentWindow;
      this.inner.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      this.ready = new Promise((resolve) => {
        const script = this.inner.document.createElement("script");
        script.src = new URL(url, location.href);
        script.onload = resolve;
        this.inner.document.body.append(script);
      });
    }
    async postMessage(data) {
      await this.ready;
      this.inner.dispatchEvent(new MessageEvent("message", { data }));
    }
  }

  const Inner = location.protocol === "file:" ? FrameWorker : window.Worker;
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.inner = new Inner(url);
      this.inner.addEventListener("message", ({ data }) => {
        if (data.type === RESULT) data.data.items = withAllWords(data.data.items);
        this.dispatchEvent(new MessageEvent("message", { data }));
      });
    }
    postMessage(message) {
      if (message.type === QUERY) message = { type: QUERY, data: stems(message.data).join(" ") };
      this.inner.postMessage(message);
    }
  };
})();
