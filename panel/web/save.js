// Saves what is shown.

function download(url, name) {
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
}

// `range`: [begin, end] in s; columns by name.
export function saveData(kind, node, columns, range) {
  const query = new URLSearchParams({columns: columns.join(","), begin: range[0], end: range[1]});
  download(`save.${kind}?${query}`, `${fileName(node)}.${kind}`);
}

function fileName(node) {
  return node.replace(/^\//, "").replaceAll("/", "_");
}

// The plots as one picture: curves are canvases, labels are text in the page.
function paint(element, scale) {
  const frame = element.getBoundingClientRect();
  const canvas = document.createElement("canvas");
  canvas.width = frame.width * scale;
  canvas.height = element.scrollHeight * scale;
  const pen = canvas.getContext("2d");
  pen.scale(scale, scale);
  pen.fillStyle = "#ffffff";
  pen.fillRect(0, 0, canvas.width, canvas.height);
  const place = (box) => [box.left - frame.left, box.top - frame.top + element.scrollTop, box.width, box.height];
  for (const layer of element.querySelectorAll("canvas")) {
    if (getComputedStyle(layer).display !== "none") pen.drawImage(layer, ...place(layer.getBoundingClientRect()));
  }
  for (const dash of element.querySelectorAll(".chip i")) {
    pen.fillStyle = getComputedStyle(dash).backgroundColor;
    pen.fillRect(...place(dash.getBoundingClientRect()));
  }
  const texts = document.createTreeWalker(element, NodeFilter.SHOW_TEXT);
  pen.textBaseline = "middle";
  while (texts.nextNode()) {
    const node = texts.currentNode;
    if (!node.textContent.trim() || node.parentElement.closest("button, .picker, option")) continue;
    const span = document.createRange();
    span.selectNodeContents(node);
    const [x, y, , height] = place(span.getBoundingClientRect());
    const style = getComputedStyle(node.parentElement);
    pen.font = `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
    pen.fillStyle = style.color;
    pen.fillText(node.textContent, x, y + height / 2);
  }
  return canvas;
}

export function savePicture(node, element) {
  const canvas = paint(element, Math.max(2, window.devicePixelRatio));
  canvas.toBlob((blob) => {
    const url = URL.createObjectURL(blob);
    download(url, `${fileName(node)}.png`);
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  });
}
