// Wide tables scroll; keyboards reach them, too. The theme wraps tables after the page has loaded.
const makeFocusable = () =>
  document.querySelectorAll(".md-typeset__scrollwrap:not([tabindex])").forEach((wrap) => (wrap.tabIndex = 0));
new MutationObserver(makeFocusable).observe(document.body, { childList: true, subtree: true });
makeFocusable();
