// Code and tables that are wider than the page scroll, those of notebooks too, and the keyboard reaches them.
addEventListener("load", () => {
  const parts = document.querySelectorAll("pre, .table-wrapper, .lcorpp");
  const mark = () => {
    for (const part of parts) {
      if (part.scrollWidth > part.clientWidth) part.tabIndex = 0;
      else part.removeAttribute("tabindex");
    }
  };
  addEventListener("resize", mark);
  mark();
});
