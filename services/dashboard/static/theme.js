// Sets the theme before the first paint: from the address, else as it was chosen last.
document.documentElement.dataset.theme =
  new URLSearchParams(location.search).get("theme") ?? localStorage.getItem("theme") ?? "auto";
