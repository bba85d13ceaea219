// Sends the events of a gamepad, or of keys that act as one, to the studio, by SDL's names of the controls.
"use strict";
(() => {
  const BUTTONS = [
    "a", "b", "x", "y", "leftshoulder", "rightshoulder", "lefttrigger", "righttrigger", "back", "start",
    "leftstick", "rightstick", "dpup", "dpdown", "dpleft", "dpright", "guide",
  ]; // the standard mapping of the Gamepad API
  const AXES = ["leftx", "lefty", "rightx", "righty"];
  const KEYS = {
    KeyW: ["lefty", -1], KeyS: ["lefty", 1], KeyA: ["leftx", -1], KeyD: ["leftx", 1],
    ArrowUp: ["righty", -1], ArrowDown: ["righty", 1], ArrowLeft: ["rightx", -1], ArrowRight: ["rightx", 1],
    KeyR: ["rightshoulder", 1], KeyF: ["leftshoulder", 1], KeyQ: ["dpleft", 1], KeyE: ["dpright", 1],
    KeyC: ["righttrigger", 1], KeyV: ["lefttrigger", 1], Space: ["a", 1], ShiftLeft: ["b", 1],
    Tab: ["y", 1], Backspace: ["x", 1], Enter: ["start", 1], Escape: ["back", 1],
  };
  const PERIOD = 5; // ms between two looks at the pads; half a control period
  const address = location.href.split("?")[0].replace(/^http/, "ws").replace(/\/$/, "") + "/pad";
  const told = {};
  const down = new Set();
  let socket = null;

  function tell(control, value) {
    if ((told[control] || 0) === value || !socket || socket.readyState !== WebSocket.OPEN) return;
    told[control] = value;
    socket.send(JSON.stringify([control, value]));
  }
  function connect() {
    for (const control in told) delete told[control];
    socket = new WebSocket(address);
    socket.onclose = () => setTimeout(connect, 500);
  }
  function keys() {
    const wanted = {};
    for (const code in KEYS) wanted[KEYS[code][0]] = 0;
    for (const code of down) wanted[KEYS[code][0]] += KEYS[code][1];
    return wanted;
  }
  function look() {
    const wanted = keys();
    for (const pad of navigator.getGamepads()) {
      if (!pad || !pad.connected || pad.mapping !== "standard") continue;
      AXES.forEach((name, number) => { wanted[name] = (wanted[name] || 0) + pad.axes[number]; });
      BUTTONS.forEach((name, number) => {
        if (number < pad.buttons.length) wanted[name] = (wanted[name] || 0) + pad.buttons[number].value;
      });
    }
    for (const name in wanted) {
      const button = !AXES.includes(name) && !name.endsWith("trigger");
      const value = Math.max(AXES.includes(name) ? -1 : 0, Math.min(1, wanted[name]));
      tell(name, button ? Number(value > 0.5) : Math.round(value * 1e4) / 1e4);
    }
  }
  function key(event) {
    const typing = event.target.matches && event.target.matches("input, textarea, [role=slider]");
    if (typing || !(event.code in KEYS) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopImmediatePropagation(); // the keys of viser's page rest meanwhile
    if (event.type === "keydown") down.add(event.code); else down.delete(event.code);
    look();
  }
  addEventListener("keydown", key, true);
  addEventListener("keyup", key, true);
  addEventListener("blur", () => { down.clear(); look(); });
  setInterval(look, PERIOD);
  connect();
})();
