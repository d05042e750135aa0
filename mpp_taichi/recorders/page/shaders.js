// What the graphics card computes: spheres that are exact at any size, and lines of any width, both with smooth edges.
// Light and shading are those of mpp_taichi/views/renderer.py. Lengths are in camera distances, depths grow away from the eye.

const COMMON = `#version 300 es
precision highp float;
uniform vec2 halfSize;       // of the picture [pixels]
uniform float focal;         // pixels per x/z, or per x where orthographic
uniform bool orthographic;
const float NEAR = 1.0e-3;
`;

// The square that a vertex belongs to: its numbers, and the corner, 0 or 1 in each direction, of two triangles.
const FETCH = `
uniform highp sampler2D numbers;
vec4 number(int texels, int k) {
  int place = gl_VertexID / 6 * texels + k, width = textureSize(numbers, 0).x;
  return texelFetch(numbers, ivec2(place % width, place / width), 0);
}
vec2 cornerOf() {
  int k = gl_VertexID % 6;
  return vec2(k == 1 || k == 3 || k == 4, k == 2 || k == 4 || k == 5);
}
`;

// Written for each pixel, 0 to 1: 24 bits tell depths of (1 + depth)² 2⁻²⁴ camera distances apart.
const DEPTH = `
float written(float depth) { return depth / (1.0 + depth); }
`;

const SPHERE_VERTEX = `${COMMON}${FETCH}
out vec2 ray;                // x/z, or x where orthographic
flat out vec3 middle;
flat out float reach;
flat out vec3 albedo;

// Slopes of the two lines from the eye that touch a sphere, in the plane of one screen axis and the depth.
vec2 tangents(float side, float depth, float radius) {
  if (depth - radius < NEAR) return vec2(-1.0e6, 1.0e6);
  float square = depth * depth - radius * radius;
  float width = radius * sqrt(max(side * side + square, 0.0));
  return vec2(side * depth - width, side * depth + width) / square;
}

void main() {
  vec3 center = number(2, 0).xyz, color = number(2, 1).rgb;   // right, up, depth
  float radius = number(2, 0).w;
  vec2 across = vec2(center.x - radius, center.x + radius), upward = vec2(center.y - radius, center.y + radius);
  if (!orthographic) { across = tangents(center.x, center.z, radius); upward = tangents(center.y, center.z, radius); }
  vec2 edge = halfSize / focal * 1.01, pixel = vec2(0.6 / focal);   // half a pixel is partly covered
  vec2 low = clamp(vec2(across.x, upward.x) - pixel, -edge, edge), high = clamp(vec2(across.y, upward.y) + pixel, -edge, edge);
  ray = mix(low, high, cornerOf());
  middle = center;
  reach = radius;
  albedo = mix(color / 12.92, pow((color + 0.055) / 1.055, vec3(2.4)), step(0.04045, color));
  gl_Position = vec4(ray * focal / halfSize, 0.0, 1.0);
}`;

const SPHERE_FRAGMENT = `${COMMON}${DEPTH}
in vec2 ray;
flat in vec3 middle;
flat in float reach;
flat in vec3 albedo;
out vec4 shown;
const vec3 LIGHT = vec3(-0.45, 0.6, -0.66) / 0.99905;   // from where: upper left, before the scene
const float AMBIENT = 0.12, DIFFUSE = 0.88, SPECULAR = 0.18;

void main() {
  vec3 start = orthographic ? vec3(ray, 0.0) : vec3(0.0), along = orthographic ? vec3(0.0, 0.0, 1.0) : vec3(ray, 1.0);
  // From the point of the ray nearest to the centre, so that far small spheres keep their shape in single precision.
  float nearest = dot(middle - start, along) / dot(along, along);
  vec3 beside = middle - start - nearest * along;
  float distance = length(beside);
  float perPixel = (orthographic ? 1.0 : nearest) / focal;
  float coverage = clamp(0.5 + (reach - distance) / perPixel, 0.0, 1.0);
  if (nearest < 0.0 || coverage == 0.0) discard;
  float half_ = sqrt(max(reach * reach - distance * distance, 0.0));
  float depth = nearest - half_ / length(along);
  if (depth < NEAR) discard;
  vec3 normal = (half_ * -normalize(along) - beside) / max(reach, 1.0e-30);
  vec3 halfway = normalize(LIGHT - normalize(along));
  float diffuse = max(dot(normal, LIGHT), 0.0), shine = max(dot(normal, halfway), 0.0);
  for (int k = 0; k < 5; k++) shine *= shine;
  vec3 light = clamp(albedo * (AMBIENT + DIFFUSE * diffuse) + SPECULAR * shine, 0.0, 1.0);
  shown = vec4(mix(12.92 * light, 1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, light)), coverage);
  gl_FragDepth = written(depth);
}`;

const LINE_VERTEX = `${COMMON}${FETCH}
out vec2 pixel;
flat out vec4 ends;          // of both ends on the screen [pixels]
flat out vec2 weights;       // 1/depth of both ends, which is linear on the screen, or the depth where orthographic
flat out vec4 ink;           // colour and half the width

vec3 inFront(vec3 point, vec3 other) {
  return point.z >= NEAR ? point : point + (NEAR - point.z) / (other.z - point.z) * (other - point);
}
vec2 onScreen(vec3 point) { return point.xy * (orthographic ? focal : focal / point.z); }

void main() {
  vec3 first = number(3, 0).xyz, second = number(3, 1).xyz, color = number(3, 2).rgb;
  float width = number(3, 0).w;
  vec2 corner = 2.0 * cornerOf() - 1.0;   // along, across
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (first.z < NEAR && second.z < NEAR) return;
  vec3 a = inFront(first, second), b = inFront(second, first);
  ends = vec4(onScreen(a), onScreen(b));
  weights = orthographic ? vec2(a.z, b.z) : 1.0 / vec2(a.z, b.z);
  ink = vec4(color, 0.5 * width);
  vec2 along = ends.zw - ends.xy, direction = length(along) > 1.0e-6 ? normalize(along) : vec2(1.0, 0.0);
  vec2 across = vec2(-direction.y, direction.x);
  float margin = 0.5 * width + 1.0;
  pixel = mix(ends.xy, ends.zw, 0.5 * corner.x + 0.5) + margin * (corner.x * direction + corner.y * across);
  gl_Position = vec4(pixel / halfSize, 0.0, 1.0);
}`;

const LINE_FRAGMENT = `${COMMON}${DEPTH}
in vec2 pixel;
flat in vec4 ends;
flat in vec2 weights;
flat in vec4 ink;
out vec4 shown;

void main() {
  vec2 along = ends.zw - ends.xy, offset = pixel - ends.xy;
  float share = clamp(dot(offset, along) / max(dot(along, along), 1.0e-12), 0.0, 1.0);
  float coverage = clamp(0.5 + ink.w - length(offset - share * along), 0.0, min(1.0, 2.0 * ink.w));
  if (coverage == 0.0) discard;
  float weight = mix(weights.x, weights.y, share);
  shown = vec4(ink.rgb, coverage);
  // What is mostly background hides nothing, or spheres behind it, which are drawn later, would get a fringe.
  gl_FragDepth = coverage < 0.5 ? 1.0 : written(orthographic ? weight : 1.0 / weight);
}`;
