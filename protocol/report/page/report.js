// Draws the page from the data that platen put into it: one object a run, see protocol/report/run_data.h.
'use strict';
(function () {
  const runs = JSON.parse(document.getElementById('data').textContent).runs;
  const several = runs.length > 1;
  const colours = ['#1f6feb', '#d1480f', '#1a7f37', '#8250df', '#b08800', '#0a7d91', '#bf3989', '#57606a'];
  const colour = (k) => colours[k % colours.length];

  // ---- small helpers --------------------------------------------------------------------------------------------
  function make(tag, attributes, ...children) {
    const node = document.createElement(tag);
    for (const key in attributes || {}) node.setAttribute(key, attributes[key]);
    for (const child of children) node.append(child);
    return node;
  }
  const place = (id) => document.getElementById(id);
  const known = (x) => x !== null && x !== undefined && Number.isFinite(x);
  function figures(x, digits) {
    if (!known(x)) return '–';
    if (x === 0) return '0';
    const size = Math.abs(x);
    return size >= 1e5 || size < 1e-3 ? x.toExponential(digits - 1) : String(Number(x.toPrecision(digits)));
  }
  const unit = (x, digits, name) => (known(x) ? figures(x, digits) + ' ' + name : '–');
  const percent = (x, digits) => (known(x) ? figures(100 * x, digits) + ' %' : '–');
  const stress = (x) => (known(x) ? unit(x / 1000, 3, 'kPa') : '–');
  const stage_of_kind = (run, kind) => run.stages.filter((s) => s.kind === kind);
  const last = (list) => list[list.length - 1];

  // ---- head -----------------------------------------------------------------------------------------------------
  place('title').textContent = several ? 'Comparison of ' + runs.length + ' runs' : runs[0].title || runs[0].name;
  runs.forEach((run, k) => {
    const row = make('div', { class: 'run', style: 'border-left-color:' + colour(k) }, make('b', {}, run.name));
    if (several || run.title !== place('title').textContent) row.append(make('span', {}, run.title));
    row.append(make('span', run.good ? {} : { class: 'bad' }, run.state));
    if (run.particles) {
      const R = run.particles.radius.map((r) => 1000 * r * run.particles.unit), [low, high] = [R.reduce((a, b) => Math.min(a, b)), R.reduce((a, b) => Math.max(a, b))];
      row.append(make('span', {}, run.particles.count.toLocaleString('en') + ' spheres, R = ' + (low === high ? '' : figures(low, 3) + ' to ') + figures(high, 3) + ' mm'));
    }
    if (run.performance)
      row.append(make('span', {}, unit(run.performance.wall_seconds, 3, 's') + ' on ' + run.performance.threads + (run.performance.threads === 1 ? ' thread, ' : ' threads, ') +
        unit(run.performance.particle_steps_per_second / 1e6, 3, 'M particle-steps/s')));
    if (run.state_hash) row.append(make('span', {}, 'state ', make('code', {}, run.state_hash)));
    place('runs').append(row);
  });
  const warnings = [];
  runs.forEach((run) => run.stages.forEach((s) => s.warnings.forEach((w) => warnings.push((several ? run.name + ', ' : '') + s.name + ': ' + w))));
  if (warnings.length) place('warnings').append(make('ul', { class: 'warnings' }, ...warnings.map((w) => make('li', {}, w))));

  // ---- what was found -------------------------------------------------------------------------------------------
  const results = [
    ['strain at the end of loading', (r) => percent(last(stage_of_kind(r, 'compress'))?.values.strain, 3)],
    ['residual strain, unloaded', (r) => percent(last(stage_of_kind(r, 'unload'))?.values.strain, 3)],
    ['porosity at the end of loading', (r) => figures(last(stage_of_kind(r, 'compress'))?.values.porosity, 3)],
    ['coordination number there', (r) => figures(last(stage_of_kind(r, 'compress'))?.values.coordination_number, 3)],
    ['unconfined strength', (r) => { const s = last(stage_of_kind(r, 'crush')); return s && known(s.strength) ? stress(s.strength) + (s.peak_found === false ? ', no peak' : '') : '–'; }],
    ['at a strain of', (r) => percent(last(stage_of_kind(r, 'crush'))?.strength_strain, 3)],
    ['initial stiffness, unconfined', (r) => { const s = last(stage_of_kind(r, 'crush')); return s && known(s.initial_stiffness) ? unit(s.initial_stiffness / 1e6, 3, 'MPa') : '–'; }],
  ].filter(([, value]) => runs.some((r) => value(r) !== '–'));
  if (several) {
    place('cards').className = 'scroll';
    const head = make('tr', {}, make('th', { class: 'text' }, 'run'), ...results.map(([name]) => make('th', {}, name)));
    place('cards').append(make('table', {}, make('thead', {}, head), make('tbody', {}, ...runs.map((run) =>
      make('tr', {}, make('td', { class: 'text' }, run.name), ...results.map(([, value]) => make('td', {}, value(run))))))));
  } else {
    for (const [name, value] of results) place('cards').append(make('div', { class: 'card' }, make('div', {}, name), make('b', {}, value(runs[0]))));
  }

  // ---- stages ---------------------------------------------------------------------------------------------------
  const columns = [
    ['stage', (s) => s.name, true], ['ended by', (s) => s.end_reason, true], ['simulated', (s) => unit(s.time, 3, 's')],
    ['steps', (s) => (known(s.steps) ? s.steps.toLocaleString('en') : '–')],
    ['stress, top', (s) => stress(s.values.stress_top)], ['strain', (s) => percent(s.values.strain, 4)],
    ['porosity', (s) => figures(s.values.porosity, 4)], ['CN', (s) => figures(s.values.coordination_number, 3)],
    ['height', (s) => (known(s.values.height) ? unit(1000 * s.values.height, 4, 'mm') : '–')],
    ['ledger open by', (s) => percent(known(s.energy_residual_share) ? Math.abs(s.energy_residual_share) : null, 2)],
    ['smallest dt', (s) => (s.time_step ? unit(1e6 * s.time_step.smallest, 3, 'µs') : '–')],
    ['dt over dt_limit, at most', (s) => (s.time_step ? figures(s.time_step.largest_over_dt_limit, 2) : '–')],
    ['which contact rules', (s) => (s.time_step ? s.time_step.ruled_by || '–' : '–'), true],
  ];
  const body = make('tbody', {});
  runs.forEach((run) => run.stages.forEach((s) => body.append(make('tr', {}, ...(several ? [make('td', { class: 'text' }, run.name)] : []),
    ...columns.map(([, value, text]) => make('td', text ? { class: 'text' } : {}, value(s)))))));
  place('stages').append(make('table', {}, make('thead', {}, make('tr', {}, ...(several ? [make('th', { class: 'text' }, 'run')] : []),
    ...columns.map(([name, , text]) => make('th', text ? { class: 'text' } : {}, name)))), body));

  // ---- plots ----------------------------------------------------------------------------------------------------
  Chart.defaults.font.family = getComputedStyle(document.body).fontFamily;
  Chart.defaults.color = '#5b6675';
  Chart.defaults.animation = false;

  // Drag to zoom, double click to go back.
  const zoom = {
    id: 'zoom',
    afterInit(chart) {
      const canvas = chart.canvas, listening = new AbortController(), until = { signal: listening.signal };
      chart.stop_listening = () => listening.abort();
      let from = null;
      const at = (event) => { const box = canvas.getBoundingClientRect(); return { x: event.clientX - box.left, y: event.clientY - box.top }; };
      const inside = (p) => { const a = chart.chartArea; return { x: Math.min(a.right, Math.max(a.left, p.x)), y: Math.min(a.bottom, Math.max(a.top, p.y)) }; };
      canvas.addEventListener('mousedown', (e) => { from = inside(at(e)); }, until);
      canvas.addEventListener('mousemove', (e) => { if (from) { chart.frame = [from, inside(at(e))]; chart.draw(); } }, until);
      window.addEventListener('mouseup', (e) => {
        if (!from) return;
        const to = inside(at(e)), begin = from;
        from = null, chart.frame = null;
        if (Math.abs(to.x - begin.x) > 8 && Math.abs(to.y - begin.y) > 8)
          for (const axis of ['x', 'y']) {
            const values = [begin, to].map((p) => chart.scales[axis].getValueForPixel(p[axis])).sort((a, b) => a - b);
            chart.options.scales[axis].min = values[0], chart.options.scales[axis].max = values[1];
          }
        chart.update();
      }, until);
      canvas.addEventListener('dblclick', () => {
        for (const axis of ['x', 'y']) delete chart.options.scales[axis].min, delete chart.options.scales[axis].max;
        chart.update();
      }, until);
    },
    afterDestroy(chart) { chart.stop_listening(); },
    afterDraw(chart) {
      if (!chart.frame) return;
      const [a, b] = chart.frame;
      chart.ctx.save();
      chart.ctx.fillStyle = 'rgba(31,111,235,0.12)';
      chart.ctx.fillRect(a.x, a.y, b.x - a.x, b.y - a.y);
      chart.ctx.restore();
    },
  };

  const charts = {};
  // lines: [{label, colour, dash, points: [[x, y] ...]}]; a point with y null breaks the line.
  function plot(id, title, note, x, y, lines, options = {}) {
    lines = lines.filter((line) => line.points.some((p) => known(p[1])));
    if (charts[id]) charts[id].destroy(), delete charts[id];
    let figure = place('plot-' + id);
    if (!lines.length) { if (figure) figure.remove(); return; }
    if (!figure) {
      figure = make('figure', { id: 'plot-' + id }, make('h3', {}, title), make('p', {}, note), make('div', { class: 'plot' }, make('canvas', { role: 'img', 'aria-label': title })));
      place(options.into || 'plots').append(figure);
    }
    const axis = (name, log) => ({ type: log ? 'logarithmic' : 'linear', bounds: log ? 'data' : 'ticks', title: { display: true, text: name }, grid: { color: '#eceff2' }, ticks: { maxTicksLimit: 9, callback: (v) => (log ? (Number.isInteger(Math.log10(v)) ? v.toExponential(0) : '') : figures(v, 6)) } });
    charts[id] = new Chart(figure.querySelector('canvas'), {
      type: 'line',
      data: {
        datasets: lines.map((line) => ({
          label: line.label, borderColor: line.colour, backgroundColor: line.colour, borderWidth: line.width || 1.6, borderDash: line.dash || [],
          pointRadius: line.points.length === 1 ? 5 : line.points.length < 40 ? 2.5 : 0, pointHitRadius: 6, stepped: line.stepped || false,
          data: line.points.map((p) => ({ x: p[0], y: known(p[1]) && !(options.log && p[1] <= 0) ? p[1] : null })),
        })),
      },
      options: {
        maintainAspectRatio: false, spanGaps: false,
        interaction: { mode: 'nearest', intersect: false },
        scales: { x: axis(x, false), y: axis(y, options.log) },
        plugins: {
          legend: { display: lines.filter((l) => l.label).length > 1, labels: { boxWidth: 22, boxHeight: 2, filter: (item) => item.text !== '' } },
          tooltip: { callbacks: { title: () => '', label: (item) => (item.dataset.label ? item.dataset.label + ': ' : '') + figures(item.parsed.x, 4) + ', ' + figures(item.parsed.y, 4) } },
        },
      },
      plugins: [zoom],
    });
  }

  // Rows of the stages of a kind, with a break between two stages.
  function rows(run, kinds, x, y) {
    const points = [];
    run.stages.forEach((stage, number) => {
      if (kinds && !kinds.includes(stage.kind)) return;
      const s = run.series;
      if (points.length && kinds) points.push([points[points.length - 1][0], null]);
      for (let k = 0; k < s.stage.length; ++k)
        if (s.stage[k] === number) {
          const a = x(s, k), b = y(s, k);
          if (known(a)) points.push([a, b]);
        }
    });
    return points;
  }
  const of = (key, factor = 1) => (s, k) => (known(s[key][k]) ? factor * s[key][k] : null);
  const named = (run, what) => (several ? run.name + (what ? ', ' + what : '') : what);

  // Branches of loading, unloading: the run's colour, unloading dashed.
  function branches(x, y) {
    return runs.flatMap((run, k) => [
      { label: named(run, several ? '' : 'loading'), colour: colour(k), points: rows(run, ['compress'], x, y) },
      { label: several ? '' : 'unloading', colour: colour(k), dash: [5, 4], points: rows(run, ['unload'], x, y) },
    ]);
  }
  plot('confined', 'Confined compression', 'Stress on the top plate over strain; dashed: unloading. Drag to zoom, double click to go back.', 'strain (%)', 'stress (kPa)', branches(of('strain', 100), of('stress_top', 1e-3)));
  plot('crush', 'Unconfined compression', 'Without sides. The dot is the strength: the largest stress, mean over 5 ms.', 'strain (%)', 'stress (kPa)',
    runs.flatMap((run, k) => [
      { label: named(run, ''), colour: colour(k), points: rows(run, ['crush'], of('strain', 100), of('stress_top', 1e-3)) },
      { label: '', colour: colour(k), points: stage_of_kind(run, 'crush').filter((s) => known(s.strength)).map((s) => [100 * s.strength_strain, s.strength / 1000]) },
    ]));
  plot('porosity', 'Porosity', 'Between the plates, overlaps not subtracted; dashed: unloading.', 'stress (kPa)', 'porosity', branches(of('stress_top', 1e-3), of('porosity')));
  plot('coordination', 'Coordination number', 'Touching pairs of spheres, twice, over spheres; dashed: unloading.', 'stress (kPa)', 'coordination number', branches(of('stress_top', 1e-3), of('coordination_number')));
  const profile_stage = (run) => last(stage_of_kind(run, 'compress').filter((s) => s.profile)) || last(run.stages.filter((s) => s.profile));
  plot('profile', 'Porosity over height', 'Slabs from plate to plate, at the end of loading, else of the last stage that has a profile (faint: of the stage before).', 'porosity', 'height (mm)',
    runs.flatMap((run, k) => {
      const pressed = profile_stage(run);
      if (!pressed) return [];
      const before = run.stages[run.stages.indexOf(pressed) - 1];
      const line = (s) => (s.profile.porosity || []).map((p, j) => [p, 1000 * s.profile.z[j]]).filter((p) => known(p[0]));
      return [{ label: named(run, several ? '' : pressed.name), colour: colour(k), points: line(pressed) }].concat(
        before && before.profile ? [{ label: several ? '' : before.name, colour: colour(k) + '66', points: line(before) }] : []);
    }));
  plot('time', 'Stress over time', 'Top plate; dotted: bottom plate. The whole run.', 'time (s)', 'stress (kPa)', runs.flatMap((run, k) => [
    { label: named(run, several ? '' : 'top'), colour: colour(k), points: rows(run, null, of('time'), of('stress_top', 1e-3)) },
    { label: several ? '' : 'bottom', colour: colour(k), dash: [2, 3], width: 1, points: rows(run, null, of('time'), of('stress_bottom', 1e-3)) }]));
  plot('rest', 'How quiet the bed is', 'Kinetic over potential energy; dotted: inertial number.', 'time (s)', '', runs.flatMap((run, k) => [
    { label: named(run, several ? '' : 'kinetic / potential energy'), colour: colour(k), points: rows(run, null, of('time'), of('kinetic_to_potential')) },
    { label: several ? '' : 'inertial number', colour: colour(k), dash: [2, 3], width: 1, points: rows(run, null, of('time'), of('inertial_number')) }]), { log: true });

  // ---- of one run: ledger, time step, the bed ---------------------------------------------------------------------
  const energies = [['elastic_energy', 'elastic'], ['adhesion_energy', 'adhesion'], ['tangential_energy', 'tangential springs'], ['plate_energy', 'contacts with plates'], ['plastic_dissipation', 'plastic'],
    ['viscous_dissipation', 'dashpots'], ['sliding_dissipation', 'sliding'], ['rolling_dissipation', 'rolling']];
  function show(run) {
    plot('energy', 'Where the energy is', 'Stored (full) and lost since the run began (dashed).', 'time (s)', 'energy (mJ)', energies.map(([key, name], k) => (
      { label: name, colour: colour(k), dash: key.endsWith('dissipation') ? [6, 3] : [], points: rows(run, null, of('time'), of(key, 1e3)) })), { into: 'one' });
    plot('residual', 'Energy that the ledger does not account for', 'Over all that was lost. What it should be: nothing.', 'time (s)', 'residual / dissipated (%)', [
      { label: '', colour: colour(0), points: rows(run, null, of('time'), (s, k) => {
        const lost = s.plastic_dissipation[k] + s.viscous_dissipation[k] + s.sliding_dissipation[k] + s.rolling_dissipation[k];
        return lost > 0 ? (100 * s.energy_residual[k]) / lost : null;
      }) }], { into: 'one' });
    plot('step', 'Time step', 'The step taken, and what the network of contacts allows: dt_crit without dashpots, dt_limit with them.', 'time (s)', 'step (µs)',
      [['dt', 'dt', []], ['dt_limit', 'dt_limit', [6, 3]], ['dt_crit', 'dt_crit', [2, 3]]].map(([key, name, dash], k) => (
        { label: name, colour: colour(k), dash, stepped: key === 'dt' ? 'before' : false, points: run.limits.filter((l) => known(l[key])).map((l) => [l.time, 1e6 * l[key]]) })), { into: 'one' });
    place('case').textContent = run.case;
    place('bed').hidden = !window.THREE || !run.beds.length;
    if (place('bed').hidden) return;
    try {
      view.load(run);
    } catch (error) {  // no WebGL: the rest of the page stands
      place('view').textContent = 'The bed cannot be drawn here: ' + error.message;
    }
  }

  // ---- the bed in three dimensions --------------------------------------------------------------------------------
  const ramp = [[0.27, 0.0, 0.33], [0.25, 0.28, 0.53], [0.17, 0.44, 0.56], [0.13, 0.58, 0.55], [0.29, 0.71, 0.43], [0.61, 0.82, 0.24], [0.99, 0.91, 0.14]];
  function shade(t) {
    const at = Math.min(1, Math.max(0, t)) * (ramp.length - 1), k = Math.min(ramp.length - 2, Math.floor(at)), f = at - k;
    return ramp[k].map((c, j) => c + f * (ramp[k + 1][j] - c));
  }
  const css = (c) => 'rgb(' + c.map((v) => Math.round(255 * v)).join(',') + ')';

  const view = {
    start() {
      const box = place('view');
      this.renderer = new THREE.WebGLRenderer({ antialias: true });
      this.renderer.setClearColor(0xf7f9fb);
      this.renderer.setPixelRatio(window.devicePixelRatio || 1);
      box.append(this.renderer.domElement);
      this.scene = new THREE.Scene();
      this.camera = new THREE.PerspectiveCamera(32, 1, 1e-3, 100);
      this.camera.up.set(0, 0, 1);
      this.controls = new THREE.OrbitControls(this.camera, this.renderer.domElement);
      const draw = () => this.renderer.render(this.scene, this.camera);
      this.draw = draw;
      this.controls.addEventListener('change', draw);
      const fit = () => {
        const w = box.clientWidth, h = box.clientHeight;
        if (!w || !h) return;
        this.renderer.setSize(w, h, false);
        this.camera.aspect = w / h;
        this.camera.updateProjectionMatrix();
        draw();
      };
      this.fit = fit;
      window.addEventListener('resize', fit);
      place('bed-stage').addEventListener('input', () => this.paint());
      place('bed-colour').addEventListener('change', () => this.paint());
      // A plane that cuts the bed open, from the front: what lies before it is left out.
      place('bed-cut').addEventListener('input', () => this.paint());
    },
    load(run) {
      if (!this.renderer) this.start();
      this.run = run;
      const metres = (list) => Float32Array.from(list, (v) => v * run.particles.unit);
      this.beds = run.beds.map((b) => ({ stage: b.stage, since: b.since, x: metres(b.position), moved: b.moved ? metres(b.moved) : null }));
      const n = run.particles.count, R = metres(run.particles.radius);
      this.R = (k) => (R.length === 1 ? R[0] : R[k]);
      if (this.mesh) this.scene.remove(this.mesh), this.mesh.geometry.dispose();
      const sphere = new THREE.IcosahedronBufferGeometry(1, n > 8000 ? 1 : 2);
      const g = new THREE.InstancedBufferGeometry();
      g.setAttribute('position', sphere.getAttribute('position'));
      g.setAttribute('offset', new THREE.InstancedBufferAttribute(new Float32Array(4 * n), 4));
      g.setAttribute('tint', new THREE.InstancedBufferAttribute(new Float32Array(3 * n), 3));
      this.mesh = new THREE.Mesh(g, new THREE.ShaderMaterial({
        vertexShader: 'attribute vec4 offset; attribute vec3 tint; varying vec3 c; varying vec3 n;' +
          'void main() { n = normalize(normalMatrix * position); c = tint; gl_Position = projectionMatrix * modelViewMatrix * vec4(offset.xyz + offset.w * position, 1.0); }',
        fragmentShader: 'varying vec3 c; varying vec3 n; void main() { float l = 0.38 + 0.62 * max(0.0, dot(normalize(n), normalize(vec3(0.35, 0.6, 0.8)))); gl_FragColor = vec4(c * l, 1.0); }',
      }));
      this.mesh.frustumCulled = false;
      this.scene.add(this.mesh);
      const slider = place('bed-stage');
      slider.max = this.beds.length - 1;
      slider.value = slider.max;
      slider.disabled = this.beds.length < 2;
      const extent = { low: [1e9, 1e9, 1e9], high: [-1e9, -1e9, -1e9] };
      for (const b of this.beds)
        for (let k = 0; k < b.x.length; ++k) {
          const axis = k % 3;
          extent.low[axis] = Math.min(extent.low[axis], b.x[k]), extent.high[axis] = Math.max(extent.high[axis], b.x[k]);
        }
      this.extent = extent;
      const middle = extent.low.map((v, a) => 0.5 * (v + extent.high[a])), size = Math.hypot(...extent.low.map((v, a) => extent.high[a] - v));
      this.controls.target.set(...middle);
      // So far away that the ball around the whole bed is in view.
      let largest = 0;
      for (let k = 0; k < n; ++k) largest = Math.max(largest, this.R(k));
      const distance = (0.5 * size + largest) / Math.sin(0.5 * this.camera.fov * Math.PI / 180);
      const away = new THREE.Vector3(0.65, -1.5, 0.45).normalize().multiplyScalar(distance);
      this.camera.position.set(middle[0] + away.x, middle[1] + away.y, middle[2] + away.z);
      this.camera.near = 0.01 * size, this.camera.far = 20 * size;
      this.controls.update();
      this.paint();
      this.fit();
    },
    // Layers that were level before loading: where they bend, the bed has sheared.
    level() {
      const names = this.run.stages.map((s) => s.kind), first = names.indexOf('compress');
      const before = first > 0 ? this.beds.findIndex((b) => b.stage === this.run.stages[first - 1].name) : 0;
      return this.beds[Math.max(0, before)];
    },
    paint() {
      const bed = this.beds[Number(place('bed-stage').value)], n = this.run.particles.count;
      const offset = this.mesh.geometry.getAttribute('offset'), tint = this.mesh.geometry.getAttribute('tint');
      const how = place('bed-colour').value, level = this.level();
      const cut = Number(place('bed-cut').value), { low, high } = this.extent;
      const front = low[1] + cut * (high[1] - low[1]);
      let least = 0, most = 0;
      if (how === 'moved') {
        if (bed.moved) for (const v of bed.moved) most = Math.max(most, v);
      } else {
        least = 1e9;
        for (let k = 0; k < n; ++k) least = Math.min(least, level.x[3 * k + 2]), most = Math.max(most, level.x[3 * k + 2]);
      }
      const span = most - least || 1;
      for (let k = 0; k < n; ++k) {
        const shown = cut === 0 || bed.x[3 * k + 1] >= front;
        offset.setXYZW(k, bed.x[3 * k], bed.x[3 * k + 1], bed.x[3 * k + 2], shown ? this.R(k) : 0);
        const t = how === 'moved' ? (bed.moved ? bed.moved[k] / span : 0) : (level.x[3 * k + 2] - least) / span;
        tint.setXYZ(k, ...(how === 'layers' ? (Math.floor(10 * t) % 2 ? shade(0.1 + 0.8 * t) : shade(0.1 + 0.8 * t).map((c) => 0.55 + 0.45 * c)) : shade(t)));
      }
      offset.needsUpdate = tint.needsUpdate = true;
      place('bed-name').textContent = bed.stage;
      place('bed-bar').style.background = 'linear-gradient(90deg,' + ramp.map(css).join(',') + ')';
      place('bed-least').textContent = figures(1000 * least, 3), place('bed-most').textContent = figures(1000 * most, 3) + ' mm';
      place('bed-what').textContent = how !== 'moved' ? 'height at the end of ' + level.stage : bed.since ? 'way since the end of ' + bed.since : 'way: nothing to compare with';
      this.draw();
    },
  };

  const choice = place('choice');
  if (several) {
    const select = make('select', { 'aria-label': 'run' }, ...runs.map((run, k) => make('option', { value: k }, run.name)));
    select.addEventListener('change', () => show(runs[Number(select.value)]));
    choice.append('Of one run: ', select);
  }
  show(runs[0]);
})();
