const data = JSON.parse(document.getElementById("data").textContent);
const robot = new Robot(bytesOf(document.getElementById("wasm").textContent), data);
