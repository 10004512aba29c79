/* How search orders what it finds: first the options for the words of an option, then pages whose own title has the words
   and few others; developers' records last. */
"use strict";
var Scorer = {
  objNameMatch: 11,
  objPartialMatch: -1, // a part of a name counts less than a word of a page; the other numbers are Sphinx's
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,

  score([page, title, , , score, , kind]) {
    const query = new URLSearchParams(location.search).get("q") || "";
    const words = query.toLowerCase().split(/[^\p{L}\p{N}_]+/u).filter(Boolean);
    const own = title.toLowerCase();
    const named = kind !== "object" && !own.includes(" > ") && words.every((word) => own.includes(word.replace(/s$/, "")));
    const rest = own.split(/\s+/).filter((word) => !/^(an?|the|and|of|to)$/.test(word)).length - words.length;
    const record = /^(CHANGELOG|CONTRIBUTING|docs\/(validation|claims|reliability|versioning)$)/.test(page);
    const joined = words.join("_"); // as options are named
    const option = page === "docs/environments/options" && joined.includes("_") && new Stemmer().stemWord(joined) in Search._index.terms;
    return score + (named ? 20 + 10 / (1 + Math.max(rest, 0)) : 0) + (option ? 40 : 0) - (record ? 10 : 0);
  },
};
