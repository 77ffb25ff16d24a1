{{/* The settings that a service shares with others, by what it needs. */}}

{{- define "fluxglobe.environment.store" -}}
- {name: FLUXGLOBE_STORE, value: {{ .Values.store.url | quote }}}
{{- range $name, $value := .Values.store.environment }}
- {name: {{ $name }}, value: {{ $value | quote }}}
{{- end }}
{{- end }}

{{- define "fluxglobe.environment.kafka" -}}
- {name: FLUXGLOBE_KAFKA, value: {{ .Values.kafka.bootstrapServers | quote }}}
- {name: FLUXGLOBE_KAFKA_SECURITY, value: {{ .Values.kafka.security }}}
{{- if include "fluxglobe.kafkaHasUser" . }}
- name: FLUXGLOBE_KAFKA_USER
  valueFrom: {secretKeyRef: {name: {{ .Values.kafka.secretName }}, key: user}}
- {name: FLUXGLOBE_KAFKA_PASSWORD_FILE, value: /run/secrets/kafka/password}
{{- end }}
{{- end }}

{{- define "fluxglobe.environment.postgis" -}}
- {name: FLUXGLOBE_POSTGIS, value: {{ .Values.postgis.url | quote }}}
- {name: FLUXGLOBE_POSTGIS_PASSWORD_FILE, value: /run/secrets/postgis/password}
{{- end }}

{{- define "fluxglobe.environment.cluster" -}}
- {name: FLUXGLOBE_CLUSTER, value: "http://{{ include "fluxglobe.fullname" . }}-scheduler:50050"}
{{- end }}

{{- define "fluxglobe.environment.renderWorkers" -}}
- {name: FLUXGLOBE_RENDER_WORKERS, value: "dns:{{ include "fluxglobe.fullname" . }}-render-workers:50061"}
{{- end }}
