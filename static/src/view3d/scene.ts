// SPDX-License-Identifier: GPL-3.0-or-later
//
// The 3-D view of one solved side, drawn by vtk.js. A bundle of its own: the page loads it only
// when somebody asks for the view.
import '@kitware/vtk.js/Rendering/Profiles/Geometry';
import vtkDataArray from '@kitware/vtk.js/Common/Core/DataArray';
import vtkPolyData from '@kitware/vtk.js/Common/DataModel/PolyData';
import vtkActor from '@kitware/vtk.js/Rendering/Core/Actor';
import vtkColorTransferFunction from '@kitware/vtk.js/Rendering/Core/ColorTransferFunction';
import vtkMapper from '@kitware/vtk.js/Rendering/Core/Mapper';
import vtkGenericRenderWindow from '@kitware/vtk.js/Rendering/Misc/GenericRenderWindow';
import type { ColourStop, Criterion, Scene, SceneState, Thresholds } from './contract.js';
import {
  boundary_faces,
  bone_faces,
  cells,
  motion_of,
  place,
  quarters,
  rim_edges,
  type Faces,
  type Motion,
} from './surface.js';
import { read_vtu, type Field } from './vtu.js';

type Rgb = [number, number, number];

const colours: Record<'muscle' | 'fat' | 'skin' | 'cluster' | 'bone' | 'seat', Rgb> = {
  muscle: [0.8, 0.6, 0.56],
  fat: [0.95, 0.88, 0.66],
  skin: [0.75, 0.58, 0.45],
  cluster: [0.55, 0.1, 0.1],
  bone: [0.93, 0.9, 0.83],
  seat: [0.74, 0.78, 0.82],
};
const bone_rise_mm = 6; /* how far the bone is shown above the top of the tissue */
const seat_margin_mm = 6;

interface Body {
  actor: vtkActor;
  mapper: vtkMapper;
  data: vtkPolyData;
}

function make_body(colour: Rgb): Body {
  const data = vtkPolyData.newInstance();
  const mapper = vtkMapper.newInstance({ scalarVisibility: false });
  const actor = vtkActor.newInstance();
  mapper.setInputData(data);
  actor.setMapper(mapper);
  const property = actor.getProperty();
  property.setColor(...colour);
  property.setInterpolationToFlat();
  property.setAmbient(0.35);
  property.setDiffuse(0.7);
  return { actor, mapper, data };
}

function set_shape(body: Body, points: Float32Array, polys: Uint32Array): void {
  body.data.getPoints().setData(points, 3);
  body.data.getPolys().setData(polys);
  body.data.modified();
}

/* The bone above the bowl: a wall that goes on upwards from the rim, and a lid. */
function bone_top(
  bowl: Faces,
  motion: Motion,
  scale: number,
): { points: number[]; polys: number[] } {
  const points: number[] = [];
  const polys: number[] = [];
  for (const [sx, sy] of quarters) {
    for (const edge of rim_edges(bowl, motion)) {
      const base = points.length / 3;
      const z_top = Math.max(...edge.map((n) => motion.at(n, 2, scale))) + bone_rise_mm;
      for (const n of edge) {
        const [x, y, z] = [
          sx * motion.at(n, 0, scale),
          sy * motion.at(n, 1, scale),
          motion.at(n, 2, scale),
        ];
        points.push(x, y, z, x, y, z_top);
      }
      points.push(0, 0, z_top);
      polys.push(4, base, base + 1, base + 3, base + 2, 3, base + 1, base + 3, base + 4);
    }
  }
  return { points, polys };
}

function with_offset(polys: Uint32Array, more: number[], offset: number): Uint32Array {
  const shifted: number[] = [];
  for (let i = 0; i < more.length;) {
    const n = more[i++] as number;
    shifted.push(n);
    for (let k = 0; k < n; k++) shifted.push((more[i++] as number) + offset);
  }
  return Uint32Array.from([...polys, ...shifted]);
}

function transfer(stops: ColourStop[]): vtkColorTransferFunction {
  const map = vtkColorTransferFunction.newInstance();
  for (const { value, rgb } of stops) map.addRGBPoint(value, rgb[0], rgb[1], rgb[2]);
  return map;
}

/* The muscle over each criterion; over both: the clusters that the daemon found. */
function bodies_over(field: Field, thresholds: Thresholds): Record<Criterion, Faces> {
  const muscle_over = (values: Float64Array, threshold: number): Faces =>
    boundary_faces(field, (e) => field.tissue[e] === 0 && (values[e] as number) > threshold);
  return {
    both: boundary_faces(field, (e) => (field.cluster[e] as number) > 0),
    shear: muscle_over(field.E_shear, thresholds.shear),
    compression: muscle_over(field.E_comp, thresholds.compression),
  };
}

class Tissues implements Scene {
  private readonly field: Field;
  private readonly motion: Motion;
  private readonly window: vtkGenericRenderWindow;
  private readonly faces: Record<'muscle' | 'fat' | 'skin' | 'bone', Faces>;
  private readonly over: Record<Criterion, Faces>;
  private readonly bodies: Record<'muscle' | 'fat' | 'skin' | 'cluster' | 'bone' | 'seat', Body>;
  private readonly resize: ResizeObserver;

  constructor(container: HTMLElement, vtu: string, thresholds: Thresholds) {
    const field = read_vtu(vtu);
    this.field = field;
    this.motion = motion_of(field);
    const tissue = (wanted: number): Faces =>
      boundary_faces(field, (e) => field.tissue[e] === wanted);
    const muscle = tissue(0);
    this.faces = {
      muscle,
      fat: tissue(1),
      skin: tissue(2),
      bone: bone_faces(field, muscle, this.motion.tip),
    };
    this.over = bodies_over(field, thresholds);
    this.window = vtkGenericRenderWindow.newInstance({
      background: [1, 1, 1],
      listenWindowResize: false,
    });
    this.window.setContainer(container);
    this.bodies = {
      muscle: make_body(colours.muscle),
      fat: make_body(colours.fat),
      skin: make_body(colours.skin),
      cluster: make_body(colours.cluster),
      bone: make_body(colours.bone),
      seat: make_body(colours.seat),
    };
    for (const body of Object.values(this.bodies)) this.window.getRenderer().addActor(body.actor);
    this.resize = new ResizeObserver(() => this.window.resize());
    this.resize.observe(container);
    this.window.resize();
  }

  show(state: SceneState): void {
    const { muscle, fat, skin, cluster, bone, seat } = this.bodies;
    const shown = state.cut ? quarters.slice(1) : quarters;
    for (const name of ['muscle', 'fat', 'skin'] as const) {
      const faces = this.faces[name];
      set_shape(
        this.bodies[name],
        place(faces, this.motion, state.scale, shown),
        cells(faces, shown),
      );
      this.bodies[name].actor.getProperty().setOpacity(state.bodies ? 0.12 : 1);
    }
    this.place_whole(cluster, this.over[state.bodies ?? 'both'], state.scale);
    this.place_bone(state.scale);
    this.place_seat(state.scale);
    this.colour_muscle(state, shown.length);
    muscle.mapper.setScalarVisibility(state.colour !== null && !state.bodies);
    cluster.actor.setVisibility(state.bodies !== null);
    bone.actor.setVisibility(state.bone);
    seat.actor.setVisibility(state.seat);
    fat.actor.setVisibility(true);
    skin.actor.setVisibility(true);
    this.window.getRenderer().resetCameraClippingRange();
    this.window.getRenderWindow().render();
  }

  reset_view(): void {
    const camera = this.window.getRenderer().getActiveCamera();
    camera.setFocalPoint(0, 0, 0);
    camera.setPosition(1, -1.25, 0.6);
    camera.setViewUp(0, 0, 1);
    this.window.getRenderer().resetCamera();
    camera.zoom(1.6);
    this.render();
  }

  turn(azimuth: number, elevation: number): void {
    const camera = this.window.getRenderer().getActiveCamera();
    camera.azimuth(azimuth);
    camera.elevation(elevation);
    camera.orthogonalizeViewUp();
    this.render();
  }

  zoom(factor: number): void {
    this.window.getRenderer().getActiveCamera().zoom(factor);
    this.render();
  }

  async picture(): Promise<Blob> {
    const canvas = this.window.getApiSpecificRenderWindow().getCanvas();
    if (!canvas) throw new Error('no canvas');
    this.window.getRenderWindow().render();
    return new Promise((resolve, reject) => {
      canvas.toBlob(
        (blob) => (blob ? resolve(blob) : reject(new Error('no picture'))),
        'image/png',
      );
    });
  }

  dispose(): void {
    this.resize.disconnect();
    this.window.delete();
  }

  private render(): void {
    this.window.getRenderer().resetCameraClippingRange();
    this.window.getRenderWindow().render();
  }

  private place_whole(body: Body, faces: Faces, scale: number): void {
    set_shape(body, place(faces, this.motion, scale, quarters), cells(faces, quarters));
  }

  private place_bone(scale: number): void {
    const bowl = this.faces.bone;
    const points = place(bowl, this.motion, scale, quarters);
    const top = bone_top(bowl, this.motion, scale);
    const polys = with_offset(cells(bowl, quarters), top.polys, points.length / 3);
    set_shape(this.bodies.bone, Float32Array.from([...points, ...top.points]), polys);
  }

  private place_seat(scale: number): void {
    let half = 0;
    for (let n = 0; n < this.field.node_count; n++) {
      half = Math.max(half, this.motion.at(n, 0, scale), this.motion.at(n, 1, scale));
    }
    half += seat_margin_mm;
    const z = -0.4;
    const corners = [-half, -half, z, half, -half, z, half, half, z, -half, half, z];
    set_shape(this.bodies.seat, Float32Array.from(corners), Uint32Array.from([4, 0, 1, 2, 3]));
  }

  private colour_muscle(state: SceneState, copies: number): void {
    const { muscle } = this.bodies;
    if (!state.colour) return;
    const values = this.field[state.colour];
    const { element } = this.faces.muscle;
    const per_face = Float32Array.from(element, (e) => values[e] as number);
    const all = new Float32Array(per_face.length * copies);
    for (let i = 0; i < copies; i++) all.set(per_face, i * per_face.length);
    muscle.data
      .getCellData()
      .setScalars(vtkDataArray.newInstance({ name: state.colour, values: all }));
    muscle.mapper.setLookupTable(transfer(state.stops));
    muscle.mapper.setScalarModeToUseCellData();
    muscle.mapper.setUseLookupTableScalarRange(true);
  }
}

export function create_scene(container: HTMLElement, vtu: string, thresholds: Thresholds): Scene {
  return new Tissues(container, vtu, thresholds);
}
