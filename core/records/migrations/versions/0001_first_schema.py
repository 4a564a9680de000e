"""First schema: users, patients, visits, captures, anchors, lesions, observations, dermoscopic images."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:

    op.create_table(
        "settings",
        sa.Column("key", sa.String(length=64), nullable=False),
        sa.Column("value", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("key", name=op.f("pk_settings")),
    )
    op.create_table(
        "users",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("username", sa.String(length=64), nullable=False),
        sa.Column("display_name", sa.String(length=200), nullable=False),
        sa.Column("password_hash", sa.String(length=255), nullable=False),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_users")),
        sa.UniqueConstraint("username", name=op.f("uq_users_username")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "patients",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("family_name", sa.String(length=200), nullable=False),
        sa.Column("given_name", sa.String(length=200), nullable=False),
        sa.Column("birth_date", sa.Date(), nullable=True),
        sa.Column("sex", sa.String(length=1), nullable=False),
        sa.Column("clinic_number", sa.String(length=64), nullable=False),
        sa.Column("clinic_number_key", sa.String(length=64), nullable=True),
        sa.Column("search_key", sa.String(length=1000), nullable=False),
        sa.Column("note", sa.Text(), nullable=False),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.Column("created_by", sa.Integer(), nullable=False),
        sa.Column("updated_at", sa.DateTime(), nullable=False),
        sa.Column("updated_by", sa.Integer(), nullable=False),
        sa.CheckConstraint("sex IN ('F', 'M', 'O', 'U')", name=op.f("ck_patients_sex")),
        sa.ForeignKeyConstraint(["created_by"], ["users.id"], name=op.f("fk_patients_created_by_users")),
        sa.ForeignKeyConstraint(["updated_by"], ["users.id"], name=op.f("fk_patients_updated_by_users")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_patients")),
        sa.UniqueConstraint("clinic_number_key", name=op.f("uq_patients_clinic_number_key")),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_patients_search_key", "patients", ["search_key", "id"], unique=False)
    op.create_table(
        "visits",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("patient_id", sa.Integer(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("started_at", sa.DateTime(), nullable=False),
        sa.Column("started_by", sa.Integer(), nullable=False),
        sa.Column("closed_at", sa.DateTime(), nullable=True),
        sa.Column("closed_by", sa.Integer(), nullable=True),
        sa.Column("note", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["closed_by"], ["users.id"], name=op.f("fk_visits_closed_by_users")),
        sa.ForeignKeyConstraint(["patient_id"], ["patients.id"], name=op.f("fk_visits_patient_id_patients")),
        sa.ForeignKeyConstraint(["started_by"], ["users.id"], name=op.f("fk_visits_started_by_users")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_visits")),
        sa.UniqueConstraint("patient_id", "number", name=op.f("uq_visits_patient_id_number")),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "captures",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("visit_id", sa.Integer(), nullable=False),
        sa.Column("role", sa.String(length=16), nullable=False),
        sa.Column("view", sa.String(length=200), nullable=False),
        sa.Column("stance", sa.String(length=200), nullable=False),
        sa.Column("taken_at", sa.DateTime(), nullable=False),
        sa.Column("stored_at", sa.DateTime(), nullable=False),
        sa.Column("stored_by", sa.Integer(), nullable=True),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.CheckConstraint("role IN ('psi', 'working')", name=op.f("ck_captures_role")),
        sa.ForeignKeyConstraint(["stored_by"], ["users.id"], name=op.f("fk_captures_stored_by_users")),
        sa.ForeignKeyConstraint(
            ["visit_id"], ["visits.id"], name=op.f("fk_captures_visit_id_visits"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_captures")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_captures_visit_id"), "captures", ["visit_id"], unique=False)
    op.create_table(
        "lesions",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("patient_id", sa.Integer(), nullable=False),
        sa.Column("visit_id", sa.Integer(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("site_code", sa.String(length=16), nullable=True),
        sa.Column("site_scheme", sa.String(length=16), nullable=True),
        sa.Column("site_meaning", sa.String(length=200), nullable=True),
        sa.Column("laterality", sa.String(length=8), nullable=False),
        sa.Column("state", sa.String(length=16), nullable=False),
        sa.Column("note", sa.Text(), nullable=False),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.Column("created_by", sa.Integer(), nullable=False),
        sa.Column("updated_at", sa.DateTime(), nullable=False),
        sa.Column("updated_by", sa.Integer(), nullable=False),
        sa.CheckConstraint("laterality IN ('', 'left', 'right')", name=op.f("ck_lesions_laterality")),
        sa.CheckConstraint("state IN ('active', 'removed')", name=op.f("ck_lesions_state")),
        sa.ForeignKeyConstraint(["created_by"], ["users.id"], name=op.f("fk_lesions_created_by_users")),
        sa.ForeignKeyConstraint(["patient_id"], ["patients.id"], name=op.f("fk_lesions_patient_id_patients")),
        sa.ForeignKeyConstraint(["updated_by"], ["users.id"], name=op.f("fk_lesions_updated_by_users")),
        sa.ForeignKeyConstraint(["visit_id"], ["visits.id"], name=op.f("fk_lesions_visit_id_visits")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_lesions")),
        sa.UniqueConstraint("patient_id", "number", name=op.f("uq_lesions_patient_id_number")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_lesions_visit_id"), "lesions", ["visit_id"], unique=False)
    op.create_table(
        "anchors",
        sa.Column("capture_id", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("name", sa.String(length=64), nullable=False),
        sa.Column("x", sa.Float(), nullable=False),
        sa.Column("y", sa.Float(), nullable=False),
        sa.Column("z", sa.Float(), nullable=False),
        sa.Column("pixel_u", sa.Float(), nullable=True),
        sa.Column("pixel_v", sa.Float(), nullable=True),
        sa.Column("visibility", sa.Float(), nullable=False),
        sa.Column("sigma_m", sa.Float(), nullable=False),
        sa.Column("source", sa.String(length=32), nullable=False),
        sa.ForeignKeyConstraint(
            ["capture_id"], ["captures.id"], name=op.f("fk_anchors_capture_id_captures"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("capture_id", "name", name=op.f("pk_anchors")),
    )
    op.create_table(
        "capture_images",
        sa.Column("capture_id", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("kind", sa.String(length=8), nullable=False),
        sa.Column("position", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("size_bytes", sa.Integer(), nullable=False),
        sa.CheckConstraint("kind IN ('depth', 'color')", name=op.f("ck_capture_images_kind")),
        sa.ForeignKeyConstraint(
            ["capture_id"],
            ["captures.id"],
            name=op.f("fk_capture_images_capture_id_captures"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("capture_id", "kind", "position", name=op.f("pk_capture_images")),
    )
    op.create_index(op.f("ix_capture_images_sha256"), "capture_images", ["sha256"], unique=False)
    op.create_table(
        "dermoscopic_images",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("lesion_id", sa.Integer(), nullable=False),
        sa.Column("visit_id", sa.Integer(), nullable=False),
        sa.Column("media_type", sa.String(length=32), nullable=False),
        sa.Column("width", sa.Integer(), nullable=False),
        sa.Column("height", sa.Integer(), nullable=False),
        sa.Column("size_bytes", sa.Integer(), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("note", sa.Text(), nullable=False),
        sa.Column("added_at", sa.DateTime(), nullable=False),
        sa.Column("added_by", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(
            ["added_by"], ["users.id"], name=op.f("fk_dermoscopic_images_added_by_users")
        ),
        sa.ForeignKeyConstraint(
            ["lesion_id"],
            ["lesions.id"],
            name=op.f("fk_dermoscopic_images_lesion_id_lesions"),
            ondelete="CASCADE",
        ),
        sa.ForeignKeyConstraint(
            ["visit_id"],
            ["visits.id"],
            name=op.f("fk_dermoscopic_images_visit_id_visits"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_dermoscopic_images")),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_dermoscopic_images_lesion_id"), "dermoscopic_images", ["lesion_id"], unique=False
    )
    op.create_index(op.f("ix_dermoscopic_images_sha256"), "dermoscopic_images", ["sha256"], unique=False)
    op.create_index(op.f("ix_dermoscopic_images_visit_id"), "dermoscopic_images", ["visit_id"], unique=False)
    op.create_table(
        "observations",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("lesion_id", sa.Integer(), nullable=False),
        sa.Column("visit_id", sa.Integer(), nullable=False),
        sa.Column("capture_id", sa.Integer(), nullable=False),
        sa.Column("status", sa.String(length=16), nullable=False),
        sa.Column("u", sa.Float(), nullable=True),
        sa.Column("v", sa.Float(), nullable=True),
        sa.Column("x", sa.Float(), nullable=True),
        sa.Column("y", sa.Float(), nullable=True),
        sa.Column("z", sa.Float(), nullable=True),
        sa.Column("proposed_u", sa.Float(), nullable=True),
        sa.Column("proposed_v", sa.Float(), nullable=True),
        sa.Column("proposed_x", sa.Float(), nullable=True),
        sa.Column("proposed_y", sa.Float(), nullable=True),
        sa.Column("proposed_z", sa.Float(), nullable=True),
        sa.Column("radius95_m", sa.Float(), nullable=True),
        sa.Column("confidence", sa.Float(), nullable=True),
        sa.Column("appearance_matched", sa.Boolean(), nullable=False),
        sa.Column("method", sa.String(length=64), nullable=False),
        sa.Column("reason", sa.Text(), nullable=False),
        sa.Column("candidates", sa.JSON(), nullable=False),
        sa.Column("decision", sa.String(length=16), nullable=False),
        sa.Column("decided_by", sa.Integer(), nullable=True),
        sa.Column("decided_at", sa.DateTime(), nullable=True),
        sa.Column("size_mm", sa.Float(), nullable=True),
        sa.Column("note", sa.Text(), nullable=False),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.Column("created_by", sa.Integer(), nullable=False),
        sa.Column("updated_at", sa.DateTime(), nullable=False),
        sa.Column("updated_by", sa.Integer(), nullable=False),
        sa.CheckConstraint(
            "decision IN ('proposed', 'confirmed', 'corrected', 'marked', 'rejected')",
            name=op.f("ck_observations_decision"),
        ),
        sa.CheckConstraint(
            "status IN ('found', 'predicted', 'ambiguous', 'not_visible', 'refused', 'marked')",
            name=op.f("ck_observations_status"),
        ),
        sa.ForeignKeyConstraint(
            ["capture_id"], ["captures.id"], name=op.f("fk_observations_capture_id_captures")
        ),
        sa.ForeignKeyConstraint(["created_by"], ["users.id"], name=op.f("fk_observations_created_by_users")),
        sa.ForeignKeyConstraint(["decided_by"], ["users.id"], name=op.f("fk_observations_decided_by_users")),
        sa.ForeignKeyConstraint(
            ["lesion_id"], ["lesions.id"], name=op.f("fk_observations_lesion_id_lesions"), ondelete="CASCADE"
        ),
        sa.ForeignKeyConstraint(["updated_by"], ["users.id"], name=op.f("fk_observations_updated_by_users")),
        sa.ForeignKeyConstraint(
            ["visit_id"], ["visits.id"], name=op.f("fk_observations_visit_id_visits"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_observations")),
        sa.UniqueConstraint("lesion_id", "capture_id", name=op.f("uq_observations_lesion_id_capture_id")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_observations_capture_id"), "observations", ["capture_id"], unique=False)
    op.create_index(op.f("ix_observations_visit_id"), "observations", ["visit_id"], unique=False)
    op.create_table(
        "observation_events",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("observation_id", sa.Integer(), nullable=False),
        sa.Column("at", sa.DateTime(), nullable=False),
        sa.Column("by", sa.Integer(), nullable=False),
        sa.Column("action", sa.String(length=16), nullable=False),
        sa.Column("decision", sa.String(length=16), nullable=False),
        sa.Column("status", sa.String(length=16), nullable=False),
        sa.Column("u", sa.Float(), nullable=True),
        sa.Column("v", sa.Float(), nullable=True),
        sa.Column("x", sa.Float(), nullable=True),
        sa.Column("y", sa.Float(), nullable=True),
        sa.Column("z", sa.Float(), nullable=True),
        sa.Column("detail", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["by"], ["users.id"], name=op.f("fk_observation_events_by_users")),
        sa.ForeignKeyConstraint(
            ["observation_id"],
            ["observations.id"],
            name=op.f("fk_observation_events_observation_id_observations"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_observation_events")),
        sqlite_autoincrement=True,
    )
    op.create_index(
        op.f("ix_observation_events_observation_id"), "observation_events", ["observation_id"], unique=False
    )


def downgrade() -> None:

    op.drop_index(op.f("ix_observation_events_observation_id"), table_name="observation_events")
    op.drop_table("observation_events")
    op.drop_index(op.f("ix_observations_visit_id"), table_name="observations")
    op.drop_index(op.f("ix_observations_capture_id"), table_name="observations")
    op.drop_table("observations")
    op.drop_index(op.f("ix_dermoscopic_images_visit_id"), table_name="dermoscopic_images")
    op.drop_index(op.f("ix_dermoscopic_images_sha256"), table_name="dermoscopic_images")
    op.drop_index(op.f("ix_dermoscopic_images_lesion_id"), table_name="dermoscopic_images")
    op.drop_table("dermoscopic_images")
    op.drop_index(op.f("ix_capture_images_sha256"), table_name="capture_images")
    op.drop_table("capture_images")
    op.drop_table("anchors")
    op.drop_index(op.f("ix_lesions_visit_id"), table_name="lesions")
    op.drop_table("lesions")
    op.drop_index(op.f("ix_captures_visit_id"), table_name="captures")
    op.drop_table("captures")
    op.drop_table("visits")
    op.drop_index("ix_patients_search_key", table_name="patients")
    op.drop_table("patients")
    op.drop_table("users")
    op.drop_table("settings")
