function slider(input, relative) { // an <input type=range> of 0 to 1; call what it returns with each `touch` of a sensor
  let finger = null; // the last event of the one that moves it
  return told => {
    if (told.id === finger?.id && told.touch !== finger.touch) return; // another finger beside it
    input.value = relative ? Number(input.value) + told.dx : told.x; // starts where one touches, or is where the finger is
    finger = told.phase === "up" ? null : told;
  };
}
