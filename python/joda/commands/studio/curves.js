// An editor of curves with control points. Coordinates are those of the view: x the joint's position,
// y the channel's value; what the user does is told by events, what is drawn comes back as a view.
const LEFT = 52, RIGHT = 12, TOP = 10, BOTTOM = 34, PAUSE = 40;

function ticks(low, high, most) {
  const raw = (high - low) / most;
  const power = Math.pow(10, Math.floor(Math.log10(raw)));
  const step = [1, 2, 2.5, 5, 10].map((k) => k * power).find((k) => k >= raw * 0.999);
  const out = [];
  for (let k = Math.ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; k++) out.push(k * step);
  return out;
}

export default {
  props: { view: Object },
  template: `
    <div style="width:100%;height:100%;position:relative">
    <svg ref="svg" :width="width" :height="height" @dblclick="insert" @pointermove="move"
         @pointerup="drop" @pointercancel="drop">
      <g class="grid">
        <template v-for="t in yticks">
          <line :x1="left" :x2="width - right" :y1="py(t)" :y2="py(t)" :class="{zero: Math.abs(t) < 1e-12}" />
          <text :x="left - 7" :y="py(t) + 3.5" text-anchor="end">{{ label(t) }}</text>
        </template>
        <template v-for="t in xticks">
          <line :x1="px(t)" :x2="px(t)" :y1="top" :y2="height - bottom" />
          <text :x="px(t)" :y="height - bottom + 14" text-anchor="middle">{{ label(t) }}</text>
        </template>
        <text :x="(left + width - right) / 2" :y="height - 5" text-anchor="middle">{{ view.xlabel }}</text>
        <text :transform="'translate(11,' + (height - bottom + top) / 2 + ') rotate(-90)'"
              text-anchor="middle">{{ view.ylabel }}</text>
      </g>
      <line v-if="at !== null" class="at" :x1="px(at)" :x2="px(at)" :y1="top" :y2="height - bottom" />
      <polyline v-for="line in view.lines" :class="line.kind" :points="path(line)"
                :style="{stroke: line.colour || view.colour}" />
      <circle v-for="h in handles" :key="h.component + '-' + h.point" :cx="px(h.x)" :cy="py(h.y)"
              :r="h.component === view.selected ? 5.5 : 3.5" tabindex="0" role="slider"
              :aria-label="h.label + ', control point ' + (h.point + 1)" :aria-valuenow="h.y"
              :class="{handle: true, chosen: h.component === view.selected}"
              :style="{stroke: view.colour, fill: h.component === view.selected ? view.colour : 'white'}"
              :data-handle="h.component + '-' + h.point"
              @pointerdown="grasp($event, h)" @keydown="key($event, h)"
              @dblclick.stop="$emit('remove', {component: h.component, point: h.point})">
        <title>{{ h.label }}: {{ label(h.x) }}, {{ label(h.y) }}</title>
      </circle>
      <text v-if="held" class="told" :x="px(held.x)" :y="Math.max(py(held.y) - 11, 12)"
            text-anchor="middle">{{ label(held.x) }}, {{ label(held.y) }}</text>
      <text v-if="view.empty" class="empty" :x="(left + width - right) / 2" :y="top + 16"
            text-anchor="middle">{{ view.empty }}</text>
    </svg></div>`,
  data() {
    return { width: 300, height: 160, left: LEFT, right: RIGHT, top: TOP, bottom: BOTTOM,
             held: null, frame: null, at: null };
  },
  computed: {
    y() { return this.frame || this.view.y; },
    xticks() { return ticks(...this.view.x, this.width / 80); },
    yticks() { return ticks(...this.y, (this.height - TOP - BOTTOM) / 32); },
    handles() {
      const held = this.held;
      return this.view.handles.map((h) =>
        held && h.component === held.component && h.point === held.point ? { ...h, x: held.x, y: held.y } : h);
    },
  },
  mounted() {
    this.observer = new ResizeObserver(() => {
      this.width = this.$el.clientWidth;
      this.height = this.$el.clientHeight;
    });
    this.observer.observe(this.$el);
  },
  beforeUnmount() { this.observer.disconnect(); clearTimeout(this.timer); },
  methods: {
    px(x) { const [a, b] = this.view.x; return LEFT + ((x - a) / (b - a)) * (this.width - LEFT - RIGHT); },
    py(y) { const [a, b] = this.y; return TOP + ((b - y) / (b - a)) * (this.height - TOP - BOTTOM); },
    label(value) { return String(Number(value.toPrecision(3))).replace("-", "\u2212"); },
    path(line) { return line.x.map((x, k) => this.px(x).toFixed(1) + "," + this.py(line.y[k]).toFixed(1)).join(" "); },
    place(event, [dx, dy] = [0, 0]) {
      const box = this.$refs.svg.getBoundingClientRect();
      const [a, b] = this.view.x, [c, d] = this.y;
      const x = a + ((event.clientX + dx - box.left - LEFT) / (this.width - LEFT - RIGHT)) * (b - a);
      const y = d - ((event.clientY + dy - box.top - TOP) / (this.height - TOP - BOTTOM)) * (d - c);
      return [Math.min(Math.max(x, a), b), this.view.least === null ? y : Math.max(y, this.view.least)];
    },
    grasp(event, h) {
      if (event.button) return;
      this.frame = this.view.y;
      const box = this.$refs.svg.getBoundingClientRect();
      this.from = [event.clientX, event.clientY];
      this.off = [box.left + this.px(h.x) - event.clientX, box.top + this.py(h.y) - event.clientY];
      this.grasped = { component: h.component, point: h.point, label: h.label };
      if (h.component !== this.view.selected) this.$emit("select", { component: h.component });
    },
    move(event) {
      if (!this.grasped) return;
      const far = Math.hypot(event.clientX - this.from[0], event.clientY - this.from[1]);
      if (!this.held && far < 3) return;
      if (!this.held) this.$refs.svg.setPointerCapture(event.pointerId); // no sooner: clicks would go there
      const [x, y] = this.place(event, this.off);
      const [low, high] = this.between(this.grasped);
      this.held = { ...this.grasped, x: Math.min(Math.max(x, low), high), y };
      if (this.timer) return;
      this.timer = setTimeout(() => { this.timer = null; if (this.held) this.tell("drag"); }, PAUSE);
    },
    between(h) {
      const own = this.view.handles.filter((other) => other.component === h.component);
      const [a, b] = this.view.x;
      return [own[h.point - 1] ? own[h.point - 1].x : a, own[h.point + 1] ? own[h.point + 1].x : b];
    },
    drop() {
      clearTimeout(this.timer);
      this.timer = this.grasped = null;
      if (this.held) this.tell("drop");
      this.held = this.frame = null;
    },
    tell(event) {
      const { component, point, x, y } = this.held;
      this.$emit(event, { component, point, x, y });
    },
    insert(event) {
      const [x, y] = this.place(event);
      this.$emit("insert", { x, y });
    },
    key(event, h) {
      const size = event.shiftKey ? 0.05 : 0.005, [a, b] = this.view.x, [c, d] = this.y;
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      const name = { component: h.component, point: h.point };
      if (event.key === "Delete" || event.key === "Backspace") this.$emit("remove", name);
      else if (way) this.$emit("drop", { ...name, x: h.x + way[0] * size * (b - a), y: h.y + way[1] * size * (d - c) });
      else return;
      event.preventDefault();
    },
    mark(x) { this.at = x; },
  },
};
