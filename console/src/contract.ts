/** What the service answers, as far as this page reads it; openapi.json says what each member means. */

export type Triple = [x: number, y: number, z: number];

/** GET /v1/model. */
export interface Model {
  version: string;
  bundle_name: string;
  bundle: string;
  catalogue: { name: string; length: number; beam: number; height: number }[];
  stages: string[];
  limits: { max_points: number; default_timeout_ms: number; budget_ms: number };
}

/** GET /v1/capacity. */
export interface Capacity {
  promises: { rung: string; milliseconds: number }[];
  wait_ms: number;
  queue_depth: number;
  running: number;
  workers: number;
  budget: {
    level: "ok" | "warn" | "error";
    budget_ms: number;
    good: number;
    bad: number;
    last_good_s: number | null;
    burn: Record<string, number>;
  };
}

/** POST /v1/recognise. */
export interface Recognition {
  vessel: string;
  probability: number;
  probabilities: Record<string, number>;
  unknown: boolean;
  reasons: string[];
  heading: number;
  heading_std: number;
  bow_probability: number;
  aspect_deg: number;
  true_heading_deg: number | null;
  box: { center: Triple; length: number; beam: number; height: number };
  measured_points: number;
  inferred_points: number;
  keypoints: Triple[];
  rung: string;
  rung_reason: string;
  preset: string;
  image_method: string | null;
  bundle: string;
  stage_ms: Record<string, number>;
  restored?: { points: Triple[]; measured: boolean[] };
  images?: { before: string; after: string } | null;
  descriptors?: string[] | null;
}
