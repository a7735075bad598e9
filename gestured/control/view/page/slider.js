function slider(input, relative) { // an <input type=range> of 0 to 1; call what it returns with each `touch` event
  let finger = null; // the one that moves it
  return told => {
    const who = `${told.id} ${told.touch}`;
    if ((finger ??= who) !== who) return; // another finger beside it
    input.value = relative ? Number(input.value) + told.dx : told.x; // starts where one touches, or is where the finger is
    if (told.phase === "up") finger = null;
  };
}
