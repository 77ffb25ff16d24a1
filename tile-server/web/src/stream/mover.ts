//! Draws a picture through a mesh: the picture's pixels and a mesh in, what another camera sees of it on a canvas out.
import { ACROSS, DOWN, type Mesh } from "./mesh";

const VERTEX = `#version 300 es
layout(location = 0) in vec2 knot;
layout(location = 1) in vec3 place;
out vec3 from;
void main() { from = place; gl_Position = vec4(knot, 0.0, 1.0); }`;

/** What the picture does not show is left to the globe below. */
const FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D picture;
in vec3 from;
out vec4 colour;
void main() {
  vec2 inside = step(vec2(0.0), from.xy) * step(from.xy, vec2(1.0));
  if (from.z < 0.999 || inside.x * inside.y < 0.5) discard;
  colour = vec4(texture(picture, from.xy).rgb, 1.0);
}`;

export class Mover {
  readonly canvas = document.createElement("canvas");
  readonly #gl: WebGL2RenderingContext | null;
  readonly #places: WebGLBuffer | null = null;

  constructor() {
    const gl = this.canvas.getContext("webgl2", { antialias: false, depth: false });
    this.#gl = gl;
    const program = gl && linked(gl);
    if (!gl || !program) return;
    gl.useProgram(program);
    fill(gl, gl.ARRAY_BUFFER, knots());
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    this.#places = fill(gl, gl.ARRAY_BUFFER, new Float32Array(3 * (ACROSS + 1) * (DOWN + 1)));
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 3, gl.FLOAT, false, 0, 0);
    fill(gl, gl.ELEMENT_ARRAY_BUFFER, corners());
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  }

  /** Another picture. */
  take(picture: HTMLCanvasElement): void {
    const gl = this.#gl;
    if (gl) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, picture);
  }

  draw({ places }: Mesh, width: number, height: number): void {
    const gl = this.#gl;
    if (!gl) return;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.#places);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, places);
    gl.drawElements(gl.TRIANGLES, 6 * ACROSS * DOWN, gl.UNSIGNED_SHORT, 0);
  }
}

function linked(gl: WebGL2RenderingContext): WebGLProgram {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]] as const) {
    const shader = gl.createShader(kind);
    if (!shader) continue;
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  return program;
}

function fill(gl: WebGL2RenderingContext, target: number, data: Float32Array | Uint16Array): WebGLBuffer | null {
  const buffer = gl.createBuffer();
  gl.bindBuffer(target, buffer);
  gl.bufferData(target, data, gl.DYNAMIC_DRAW);
  return buffer;
}

/** In the order of the mesh, from the upper left. */
function knots(): Float32Array {
  const all: number[] = [];
  for (let row = 0; row <= DOWN; row++)
    for (let column = 0; column <= ACROSS; column++) all.push((2 * column) / ACROSS - 1, 1 - (2 * row) / DOWN);
  return new Float32Array(all);
}

/** Two triangles a cell. */
function corners(): Uint16Array {
  const all: number[] = [];
  for (let row = 0; row < DOWN; row++) {
    for (let column = 0; column < ACROSS; column++) {
      const first = row * (ACROSS + 1) + column;
      const below = first + ACROSS + 1;
      all.push(first, below, first + 1, first + 1, below, below + 1);
    }
  }
  return new Uint16Array(all);
}
